"""The materials of a scene's triangles, as numbers, and their parameters at points."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Ids, Vectors, take_rows
from illumcli.geometry.mesh import Mesh, Substitute
from illumcli.geometry.repairs import Repairs, joined, located, path_of
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.models._base import IlluminationModel
from illumcli.models._parameters import VertexValues
from illumcli.rays.corner_weights import OnTriangles
from illumcli.records import Record, Value

Token: TypeAlias = tuple[str, ...]
"""Which material it is, whatever its parameters are: `("material", name)` of the scene, `("object", name)` of
one object, `("fallback", name)` of what its mesh has no material for, `("mesh", mesh, name)` of a mesh's own
library, or `("default",)`; behind `"colors"` with vertex colours, behind `"meant"` as exporters mean it."""

DEFAULT: Token = ("default",)


class Numbering(Record):
    """The material numbers of every object or, where meshes select several, triangle."""

    tokens: tuple[Token, ...]  # by number
    of_object: NDArray[np.int32]  # (O,) material number
    of_triangle: NDArray[np.int32] | None = None  # (T,) where it differs within objects

    def number(self, geometry: SceneGeometry, triangle: Ids) -> Ids:
        """(N,) material number of each triangle."""
        if self.of_triangle is not None:
            return self.of_triangle.take(triangle)
        return self.of_object.take(geometry.objects.take(triangle))


def material(geometry: SceneGeometry, numbering: Numbering, points: OnTriangles) -> Ids:
    """(E,) material number at every point."""
    return numbering.number(geometry, points.triangle)


def material_id(geometry: SceneGeometry, numbering: Numbering, hits: OnTriangles) -> NDArray[np.uint32]:
    """(M,) number of the material of every hit, from 1."""
    return (numbering.number(geometry, hits.triangle) + 1).astype(np.uint32)


class Choice(Value):
    """What decides about the materials of an object."""

    own: Token | None
    """The object's material; None where its mesh selects materials by name."""
    library: str | None = None
    """Name of the mesh where its file's own materials and vertex colours are imported."""
    fallback: Token | None = None
    """For polygons without a material; where it is given, no material of the scene is selected by name."""

    def token(self, mesh: Mesh, name: str | None, named: Collection[str]) -> Token:
        """The material of polygons for which the mesh selects `name`, or nothing."""
        if self.own is not None:
            return self.own
        if name in named and self.fallback is None:
            return "material", str(name)
        if self.library is not None and name in mesh.materials:
            token: Token = ("mesh", self.library, str(name))
            token = token if self.fallback is None else ("meant", *token)
        else:
            token = self.fallback or DEFAULT
        colors = mesh.attributes.get("color") if self.library is not None else None
        if colors is None or colors.ndim != 2 or colors.shape[1] < 3:
            return token
        return "colors", *token


def numbering(choices: Sequence[Choice], named: Collection[str], geometry: SceneGeometry) -> Numbering:
    """Numbers the materials of all objects.

    Parameters
    ----------
    choices : sequence
        Per object.
    named : collection of str
        The scene's materials, which a mesh file selects by name.
    """
    tokens: dict[Token, int] = {}
    of_object = np.zeros(len(choices), np.int32)
    of_triangle = np.zeros(len(geometry.triangles), np.int32)
    several = False
    for i, (placed, choice) in enumerate(zip(geometry.placed, choices, strict=True)):
        mesh = placed.mesh
        names = (None, *mesh.material_names) if choice.own is None else (None,)
        found = [tokens.setdefault(choice.token(mesh, name, named), len(tokens)) for name in names]
        if len(names) == 1:
            of_object[i] = found[0]
            continue
        several = True
        selected = (
            mesh.polygon_materials if mesh.polygon_materials is not None else np.full(mesh.polygon_count, -1)
        )
        mine = geometry.objects == i
        polygon = geometry.polygons[mine] - placed.first_polygon
        of_triangle[mine] = np.asarray(found, np.int32).take(selected.take(polygon) + 1)
    if several:
        for i, (placed, choice) in enumerate(zip(geometry.placed, choices, strict=True)):
            if choice.own is not None or not placed.mesh.material_names:
                of_triangle[geometry.objects == i] = of_object[i]
    return Numbering(tuple(tokens), of_object, of_triangle if several else None)


class Materials(Record):
    """Models by number."""

    models: tuple[IlluminationModel, ...]
    names: tuple[str, ...]
    numbering: Numbering
    lobes: tuple[Mapping[str, Any], ...]
    repairs: Repairs = field(default_factory=dict)
    """What of the meshes' own libraries is not as their files say."""
    substitutes: tuple[Mapping[str, Substitute] | None, ...] = ()
    """By number, of materials of a mesh's own library: what stands in for textures that cannot be used."""

    def substitute(self, number: int, path: str) -> Substitute | None:
        """What stands in for the texture of a parameter; None where it must be usable, as a scene's must."""
        own = self.substitutes[number] if self.substitutes else None
        return None if own is None else own.get(path, Substitute((1.0, 1.0, 1.0)))

    def number(self, geometry: SceneGeometry, triangle: Ids) -> Ids:
        """(N,) material number of each triangle."""
        return self.numbering.number(geometry, triangle)


def materials(
    numbering: Numbering, known: Mapping[Token, IlluminationModel], libraries: Mapping[str, Mesh]
) -> Materials:
    """The materials that are numbered.

    Parameters
    ----------
    known : mapping
        Those of the scene, its objects and the default.
    libraries : mapping
        Mesh by name, those whose own library is used.
    """

    models = tuple(_model_of(token, known, libraries) for token in numbering.tokens)
    imported = [own if own[0] == "mesh" else None for own in map(origin, numbering.tokens)]
    substitutes = [None if own is None else _substitutes(libraries[own[1]], own) for own in imported]
    names = tuple(token[-1] for token in numbering.tokens)
    lobes = tuple(model.lobes() for model in models)
    used = dict.fromkeys(own[1] for own in imported if own is not None)
    repairs = joined(located(libraries[name].material_repairs, name) for name in used)
    return Materials(models, names, numbering, lobes, repairs, tuple(substitutes))


def _model_of(
    token: Token, known: Mapping[Token, IlluminationModel], libraries: Mapping[str, Mesh]
) -> IlluminationModel:
    """The material of a token."""
    match token:
        case "colors", *own:
            return with_vertex_colors(_model_of(tuple(own), known, libraries), origin(token)[0] == "mesh")
        case "meant", *own:
            return as_meant(_model_of(tuple(own), known, libraries))
        case "mesh", library, name:
            return imported_model(libraries[library].materials[name], Path(library).parent)
    return known[token]


def _substitutes(mesh: Mesh, token: Token) -> dict[str, Substitute]:
    """What stands in for textures of a material of the mesh's library, with places by the mesh's path."""
    own = mesh.substitutes.get(token[2], {})
    return {key: Substitute(each.value, path_of(each.first, token[1])) for key, each in own.items()}


def origin(token: Token) -> Token:
    """The token without what stands before it."""
    return origin(token[1:]) if token[0] in ("colors", "meant") else token


def as_meant(model: IlluminationModel) -> IlluminationModel:
    """A material of a mesh's own library, without what exporters write that know nothing of it.

    Their ambient colour is most often all white or all black: light from everywhere leaves by the diffuse
    colour instead, where there is one. An exponent of 0 stands for no highlight, not for one all over. The
    intensities of MTL are taken for shares of the light, as all other formats have them: over pi, and so the
    middle of a highlight.
    """
    changes: dict[str, Any] = {}
    if model.ambient is not None and model.diffuse_color() != (0.0, 0.0, 0.0):
        changes["ambient"] = None
    own = dict(model)
    if own["model"] == "blinn_phong" and not own["normalised"]:
        e, specular = own["exponent"], own["specular"]
        middle = (e + 2) * (e + 4) / (8 * (e + 2.0 ** (-e / 2)))  # pi times models.blinn_phong's C
        share = 1 / middle if e > 0 else 0.0
        changes |= {"normalised": True, "specular": tuple(share * each for each in specular)}
    return model.model_copy(update=changes) if changes else model


def with_vertex_colors(model: IlluminationModel, is_factor: bool) -> IlluminationModel:
    """The model with vertex colours in place of a diffuse colour that does not vary, or times that colour."""
    if "diffuse" not in type(model).model_fields or "diffuse" in model.varying():
        return model
    own = dict(model)["diffuse"] if is_factor else (1.0, 1.0, 1.0)
    return (
        model.model_copy(update={"diffuse": VertexValues(vertex="color", factor=own)}) if any(own) else model
    )


def imported_model(description: Mapping[str, Any], folder: Path) -> IlluminationModel:
    """A model from the keys that a mesh file's own library gives; `folder` is that of the mesh."""
    from illumcli.schema.families import member

    keys = textures_at(description, lambda path: str(folder / path))
    return member("illumcli.models", str(keys["model"])).model_validate(keys)


def textures_at(description: Mapping[str, Any], place: Callable[[str], str]) -> dict[str, Any]:
    """The keys of a material, or of a part of one, the path of each texture in them as `place` has it."""
    return {
        key: place(value)
        if key == "texture"
        else textures_at(value, place)
        if isinstance(value, Mapping)
        else value
        for key, value in description.items()
    }


def colors_at(table: Sequence[Any], material: Ids) -> Vectors:
    """(N, 3) float32 the colour of each lane's material; black where it is something that varies."""
    known = [color if isinstance(color, tuple) else (0.0, 0.0, 0.0) for color in table]
    return take_rows(np.asfortranarray(np.asarray(known, F).reshape(-1, 3)), material)
