"""The materials of a scene's triangles, as numbers, and their parameters at points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Ids, Vectors, rows
from illumcli.geometry.assemble import World
from illumcli.models._base import IlluminationModel


@dataclass(frozen=True, slots=True, eq=False)
class Materials:
    """Models by number, and the number of every object or, where meshes select several, triangle."""

    models: tuple[IlluminationModel, ...]
    names: tuple[str, ...]
    of_object: NDArray[np.int32]  # (O,) material number
    of_triangle: NDArray[np.int32] | None = None  # (T,) where it differs within objects
    lobes: tuple[Mapping[str, Any], ...] = field(default=())

    def number(self, world: World, triangle: Ids) -> Ids:
        """(N,) material number of each triangle."""
        if self.of_triangle is not None:
            return self.of_triangle.take(triangle)
        return self.of_object.take(world.objects.take(triangle))


def materials(
    world: World,
    named: Mapping[str, IlluminationModel],
    own: Sequence[IlluminationModel | None],
    own_names: Sequence[str],
    imported: Sequence[bool],
    default: IlluminationModel,
) -> Materials:
    """The materials of all objects.

    Parameters
    ----------
    named : mapping
        The scene's materials, which a mesh file selects by name.
    own, own_names : sequences
        Each object's own material, None where its mesh selects them.
    imported : sequence
        Per object: take what the scene does not name from the mesh file's own library.
    default : IlluminationModel
        For what selects nothing that is known.
    """
    models: list[IlluminationModel] = []
    names: list[str] = []

    def number(name: str, model: IlluminationModel) -> int:
        for k, known in enumerate(models):
            if known is model or (names[k] == name and known == model):
                return k
        models.append(model)
        names.append(name)
        return len(models) - 1

    of_object = np.zeros(len(own), np.int32)
    of_triangle = np.zeros(len(world.triangles), np.int32)
    several = False
    for i, (placed, model) in enumerate(zip(world.placed, own, strict=True)):
        mesh = placed.mesh
        mine = world.objects == i if model is None and mesh.material_names else None
        if mine is None:
            of_object[i] = number(own_names[i] if model else "default", model or default)
            continue
        several = True
        choices = [number("default", default)]
        for name in mesh.material_names:
            if name in named:
                choices.append(number(name, named[name]))
            elif imported[i] and name in mesh.materials:
                choices.append(number(name, imported_model(mesh.materials[name])))
            else:
                choices.append(choices[0])
        selected = (
            mesh.polygon_materials if mesh.polygon_materials is not None else np.full(mesh.polygon_count, -1)
        )
        polygon = world.polygons[mine] - placed.first_polygon
        of_triangle[mine] = np.asarray(choices, np.int32).take(selected.take(polygon) + 1)
    if several:
        for i, (placed, model) in enumerate(zip(world.placed, own, strict=True)):
            if model is not None or not placed.mesh.material_names:
                of_triangle[world.objects == i] = of_object[i]
    return Materials(
        tuple(models),
        tuple(names),
        of_object,
        of_triangle if several else None,
        tuple(model.lobes() for model in models),
    )


def imported_model(description: Mapping[str, Any]) -> IlluminationModel:
    """A model from the keys that a mesh file's own library gives.

    Its textures lie where the library says, not in the scene's folder: their paths are made absolute.
    """
    from illumcli.variants import member

    keys = {
        name: {**value, "texture": str(Path(value["texture"]).absolute())}
        if isinstance(value, Mapping) and "texture" in value
        else value
        for name, value in description.items()
    }
    return member("illumcli.models", str(keys["model"])).model_validate(keys)


def colors_at(table: Sequence[Any], material: Ids) -> Vectors:
    """(N, 3) float32 the colour of each lane's material; black where it is something that varies."""
    known = [color if isinstance(color, tuple) else (0.0, 0.0, 0.0) for color in table]
    return rows(np.asfortranarray(np.asarray(known, F).reshape(-1, 3)), material)
