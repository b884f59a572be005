"""The materials of a scene: which triangle has which, by number, and the model of each."""

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
from illumcli.shading.batches import Batches, batches

Token: TypeAlias = tuple[str, ...]
"""Identity of a material, independent of its parameters: `("material", name)` of the scene, `("object",
name)` of one object, `("fallback", name)` for polygons of an object without a material, `("mesh", mesh,
name)` from a mesh file's library, or `("default",)`. A leading `"colors"` adds vertex colours, a leading
`"intended"` applies `as_intended`."""

DEFAULT: Token = ("default",)


class Numbering(Record):
    """The material number of every object or, if its mesh has several materials, of its triangles."""

    tokens: tuple[Token, ...]  # by number
    of_object: NDArray[np.int32]  # (O,) material number, -1 for objects that have several
    of_triangle: NDArray[np.int32]  # (K,) material numbers of the triangles of such objects
    first: NDArray[np.int64]  # (O,) row of the object's stored triangle t is `first` + t

    def number(self, objects: Ids, triangle: Ids) -> Ids:
        """(N,) material number of each triangle of an object."""
        out = self.of_object.take(objects)
        if len(self.of_triangle) and (several := np.flatnonzero(out < 0)).size:
            row = self.first.take(objects.take(several)) + triangle.take(several)
            out[several] = self.of_triangle.take(row)
        return out


def material(numbering: Numbering, points: OnTriangles) -> Ids:
    """(E,) material number at every point."""
    return numbering.number(points.objects, points.triangle)


def material_id(numbering: Numbering, hits: OnTriangles) -> NDArray[np.uint32]:
    """(M,) number of the material of every hit, from 1."""
    return (numbering.number(hits.objects, hits.triangle) + 1).astype(np.uint32)


class Choice(Value):
    """How the materials of an object are chosen."""

    own: Token | None
    """The object's material; None if its mesh selects materials by name."""
    library: str | None = None
    """Name of the mesh, if the materials and vertex colours of its file are imported."""
    fallback: Token | None = None
    """For polygons without a material. If it is given, the mesh selects none of the scene's materials."""

    def token(self, mesh: Mesh, name: str | None, named: Collection[str]) -> Token:
        """The material of polygons for which the mesh selects `name`, or nothing."""
        if self.own is not None:
            return self.own
        if name in named and self.fallback is None:
            return "material", str(name)
        if self.library is not None and name in mesh.materials:
            token: Token = ("mesh", self.library, str(name))
            token = token if self.fallback is None else ("intended", *token)
        else:
            token = self.fallback or DEFAULT
        colors = mesh.attributes.get("color") if self.library is not None else None
        if colors is None or colors.ndim != 2 or colors.shape[1] < 3:
            return token
        return "colors", *token


def numbering(choices: Sequence[Choice], named: Collection[str], geometry: SceneGeometry) -> Numbering:
    """Number the materials of all objects.

    Parameters
    ----------
    choices : sequence
        One for each object.
    named : collection of str
        Names of the scene's materials, which a mesh file may select.
    """
    # Number the materials of each object; where a mesh selects several, those of its triangles.
    tokens: dict[Token, int] = {}
    of_object, first = np.full(len(choices), -1, np.int32), np.zeros(len(choices), np.int64)
    tables: list[NDArray[np.int32]] = []
    rows: dict[tuple[int, tuple[int, ...]], int] = {}  # objects that share a mesh may share a table
    count = 0
    starts = [*(placed.first_triangle for placed in geometry.placed), len(geometry.triangles)]
    for i, (which, choice) in enumerate(zip(geometry.placed_mesh.tolist(), choices, strict=True)):
        placed = geometry.placed[which]
        mesh = placed.mesh
        names = (None, *mesh.material_names) if choice.own is None else (None,)
        numbers = tuple(tokens.setdefault(choice.token(mesh, name, named), len(tokens)) for name in names)
        if len(names) == 1:
            of_object[i] = numbers[0]
            continue
        if (which, numbers) not in rows:
            rows[which, numbers] = count
            selected = mesh.polygon_materials
            if selected is None:
                selected = np.full(mesh.polygon_count, -1, np.int32)
            polygon = geometry.polygons[starts[which] : starts[which + 1]] - placed.first_polygon
            tables.append(np.asarray(numbers, np.int32).take(selected.take(polygon) + 1))
            count += len(polygon)
        first[i] = rows[which, numbers] - placed.first_triangle
    of_triangle = np.concatenate([np.zeros(0, np.int32), *tables])
    return Numbering(tuple(tokens), of_object, of_triangle, first)


class Materials(Record):
    """The scene's materials by number."""

    models: tuple[IlluminationModel, ...]
    names: tuple[str, ...]
    numbering: Numbering
    lobes: tuple[Mapping[str, Any], ...]
    batches: Batches
    repairs: Repairs = field(default_factory=dict)
    """Deviations from the material libraries of mesh files."""
    substitutes: tuple[Mapping[str, Substitute] | None, ...] = ()
    """By number, for materials of a mesh file's library: values that replace unusable textures."""

    def substitute(self, number: int, path: str) -> Substitute | None:
        """The value that replaces a parameter's texture if that is unusable; None for materials of the scene,
        whose textures must be usable."""
        own = self.substitutes[number] if self.substitutes else None
        return None if own is None else own.get(path, Substitute((1.0, 1.0, 1.0)))


def materials(
    numbering: Numbering, known: Mapping[Token, IlluminationModel], libraries: Mapping[str, Mesh]
) -> Materials:
    """The model of every numbered material.

    Parameters
    ----------
    known : mapping
        The materials of the scene and its objects, and the default.
    libraries : mapping
        The meshes by name whose file's library is used.
    """
    models = tuple(_model_of(token, known, libraries) for token in numbering.tokens)
    imported = [own if own[0] == "mesh" else None for own in map(origin, numbering.tokens)]
    substitutes = [None if own is None else _substitutes(libraries[own[1]], own) for own in imported]
    names = tuple(token[-1] for token in numbering.tokens)
    lobes = tuple(model.lobes() for model in models)
    used = dict.fromkeys(own[1] for own in imported if own is not None)
    repairs = joined(located(libraries[name].material_repairs, name) for name in used)
    return Materials(models, names, numbering, lobes, batches(models), repairs, tuple(substitutes))


def _model_of(
    token: Token, known: Mapping[Token, IlluminationModel], libraries: Mapping[str, Mesh]
) -> IlluminationModel:
    """The model of a material."""
    match token:
        case "colors", *own:
            return with_vertex_colors(_model_of(tuple(own), known, libraries), origin(token)[0] == "mesh")
        case "intended", *own:
            return as_intended(_model_of(tuple(own), known, libraries))
        case "mesh", library, name:
            return imported_model(libraries[library].materials[name], Path(library).parent)
    return known[token]


def _substitutes(mesh: Mesh, token: Token) -> dict[str, Substitute]:
    """Values that replace unusable textures of a material of the mesh's library, with the mesh's path."""
    own = mesh.substitutes.get(token[2], {})
    return {key: Substitute(each.value, path_of(each.first, token[1])) for key, each in own.items()}


def origin(token: Token) -> Token:
    """The token without leading `"colors"` and `"intended"`."""
    return origin(token[1:]) if token[0] in ("colors", "intended") else token


def as_intended(model: IlluminationModel) -> IlluminationModel:
    """A material of a mesh file's library, with the placeholder values that exporters write replaced.

    Exporters mostly write an ambient colour of white or black: the diffuse colour replaces it, if there is
    one. An exponent of 0 means no highlight, not a highlight everywhere. The intensities of MTL are taken as
    reflectances, as in all other formats: divided by pi, and the peak of a highlight likewise.
    """
    changes: dict[str, Any] = {}
    if model.ambient is not None and model.diffuse_color() != (0.0, 0.0, 0.0):
        changes["ambient"] = None
    own = dict(model)
    if own["model"] == "blinn_phong" and not own["normalised"]:
        e, specular = own["exponent"], own["specular"]
        peak = (e + 2) * (e + 4) / (8 * (e + 2.0 ** (-e / 2)))  # pi times models.blinn_phong's C
        factor = 1 / peak if e > 0 else 0.0
        changes |= {"normalised": True, "specular": tuple(factor * each for each in specular)}
    return model.model_copy(update=changes) if changes else model


def with_vertex_colors(model: IlluminationModel, is_factor: bool) -> IlluminationModel:
    """The model with vertex colours instead of its constant surface colour, or times it if `is_factor`."""
    name = model.surface_color
    if name not in type(model).model_fields or name in model.varying():
        return model
    own = dict(model)[name] if is_factor else (1.0, 1.0, 1.0)
    return model.model_copy(update={name: VertexValues(vertex="color", factor=own)}) if any(own) else model


def imported_model(description: Mapping[str, Any], folder: Path) -> IlluminationModel:
    """A model from the keys of a mesh file's library; `folder` is that of the mesh."""
    from illumcli.schema.families import member

    keys = textures_at(description, lambda path: str(folder / path))
    return member("illumcli.models", str(keys["model"])).model_validate(keys)


def textures_at(description: Mapping[str, Any], place: Callable[[str], str]) -> dict[str, Any]:
    """The keys of a material, or of a part of one, with ``place(path)`` for the path of each texture."""
    return {
        key: place(value)
        if key == "texture"
        else textures_at(value, place)
        if isinstance(value, Mapping)
        else value
        for key, value in description.items()
    }


def colors_at(table: Sequence[Any], material: Ids) -> Vectors:
    """(N, 3) float32 colour of each point's material; black where the colour varies over the surface."""
    known = [color if isinstance(color, tuple) else (0.0, 0.0, 0.0) for color in table]
    return take_rows(np.asfortranarray(np.asarray(known, F).reshape(-1, 3)), material)
