"""The materials of a scene's triangles, as numbers, and their parameters at points."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Ids, Vectors, rows
from illumcli.geometry.assemble import World
from illumcli.geometry.mesh import Mesh, Substitute
from illumcli.geometry.repairs import Repairs, joined, located, path_of
from illumcli.models._base import IlluminationModel
from illumcli.records import Record

Token: TypeAlias = tuple[str, ...]
"""Which material it is, whatever its parameters are: `("material", name)` of the scene, `("object", name)` of
one object, `("mesh", mesh, name)` of a mesh's own library, or `("default",)`."""

DEFAULT: Token = ("default",)


class Numbering(Record):
    """The material numbers of every object or, where meshes select several, triangle."""

    tokens: tuple[Token, ...]  # by number
    of_object: NDArray[np.int32]  # (O,) material number
    of_triangle: NDArray[np.int32] | None = None  # (T,) where it differs within objects

    def number(self, world: World, triangle: Ids) -> Ids:
        """(N,) material number of each triangle."""
        if self.of_triangle is not None:
            return self.of_triangle.take(triangle)
        return self.of_object.take(world.objects.take(triangle))


def numbering(
    world: World, own: Sequence[Token | None], named: Collection[str], imported: Sequence[str | None]
) -> Numbering:
    """Numbers the materials of all objects.

    Parameters
    ----------
    own : sequence
        Each object's own material, None where its mesh selects them.
    named : collection of str
        The scene's materials, which a mesh file selects by name.
    imported : sequence
        Per object: the name of the mesh whose own library has what the scene does not name, or None.
    """
    tokens: dict[Token, int] = {}
    of_object = np.zeros(len(own), np.int32)
    of_triangle = np.zeros(len(world.triangles), np.int32)
    several = False
    for i, (placed, token, library) in enumerate(zip(world.placed, own, imported, strict=True)):
        mesh = placed.mesh
        if token is not None or not mesh.material_names:
            of_object[i] = tokens.setdefault(token or DEFAULT, len(tokens))
            continue
        several = True
        choices = [tokens.setdefault(DEFAULT, len(tokens))]
        for name in mesh.material_names:
            if name in named:
                choices.append(tokens.setdefault(("material", name), len(tokens)))
            elif library is not None and name in mesh.materials:
                choices.append(tokens.setdefault(("mesh", library, name), len(tokens)))
            else:
                choices.append(choices[0])
        selected = (
            mesh.polygon_materials if mesh.polygon_materials is not None else np.full(mesh.polygon_count, -1)
        )
        mine = world.objects == i
        polygon = world.polygons[mine] - placed.first_polygon
        of_triangle[mine] = np.asarray(choices, np.int32).take(selected.take(polygon) + 1)
    if several:
        for i, (placed, token) in enumerate(zip(world.placed, own, strict=True)):
            if token is not None or not placed.mesh.material_names:
                of_triangle[world.objects == i] = of_object[i]
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

    def number(self, world: World, triangle: Ids) -> Ids:
        """(N,) material number of each triangle."""
        return self.numbering.number(world, triangle)


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
    models: list[IlluminationModel] = []
    substitutes: list[Mapping[str, Substitute] | None] = []
    for token in numbering.tokens:
        if token[0] == "mesh":
            mesh, folder = libraries[token[1]], Path(token[1]).parent
            models.append(imported_model(mesh.materials[token[2]], folder))
            own = mesh.substitutes.get(token[2], {})
            substitutes.append(
                {key: Substitute(each.value, path_of(each.first, token[1])) for key, each in own.items()}
            )
        else:
            models.append(known[token])
            substitutes.append(None)
    names = tuple(token[-1] for token in numbering.tokens)
    lobes = tuple(model.lobes() for model in models)
    used = dict.fromkeys(token[1] for token in numbering.tokens if token[0] == "mesh")
    repairs = joined(located(libraries[name].material_repairs, name) for name in used)
    return Materials(tuple(models), names, numbering, lobes, repairs, tuple(substitutes))


def imported_model(description: Mapping[str, Any], folder: Path) -> IlluminationModel:
    """A model from the keys that a mesh file's own library gives; `folder` is that of the mesh."""
    from illumcli.variants import member

    keys = textures_at(description, lambda path: str(folder / path))
    return member("illumcli.models", str(keys["model"])).validated(keys)


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
    return rows(np.asfortranarray(np.asarray(known, F).reshape(-1, 3)), material)
