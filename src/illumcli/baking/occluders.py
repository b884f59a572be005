"""The geometry that may occlude the vertices of each object of a bake."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, column_major, cross, unit
from illumcli.baking.settings import BakeSettings
from illumcli.errors import InputError
from illumcli.geometry.scene_geometry import SceneGeometry, triangle_corners
from illumcli.rays.embree import Tracer
from illumcli.records import Record
from illumcli.scene.spec import Scene
from illumcli.visibility.open_hemisphere import ClusterTree

GROUND_GAP = 1e-4
"""Distance of the added ground below the lowest vertex, in radii: it closes objects that stand on it."""
GROUND_SIZE = 1e3
"""Half the side of the added ground, in radii."""


class Occluders(Record):
    """Triangles that occlude the points of an object."""

    tracer: Tracer
    clusters: ClusterTree
    normals: NDArray[np.float32] | None = None  # (T, 3) unit; None if back faces occlude


def occluders_of(scene: Scene, geometry: SceneGeometry, settings: BakeSettings) -> list[Occluders]:
    """Occluders of each object: the scene, the object itself, or the object and others by name.

    Raises
    ------
    InputError
        A name in `settings.occluders` is no object, or is ambiguous.
    """
    names = scene.object_names()
    _refuse_unknown(settings.occluders, names)
    named = [names.index(name) for name in settings.occluders if name in names]
    built: dict[tuple[int, ...], Occluders] = {}
    occluders = []
    for index in range(len(names)):
        objects = tuple(range(len(names)))
        if "scene" not in settings.occluders:
            objects = tuple(sorted({index, *named}))
        if objects not in built:
            built[objects] = _occluders(geometry, objects, settings)
        occluders.append(built[objects])
    return occluders


def _refuse_unknown(occluders: Sequence[str], names: Sequence[str]) -> None:
    if "own" in occluders and "own" in names:
        raise InputError("--occluders own: an object has that name too; give the object another name")
    unknown = [name for name in occluders if name not in (*names, "scene", "own")]
    if unknown:
        raise InputError(
            f"--occluders {unknown[0]}: no object of that name; there are: scene, own, {', '.join(names)}"
        )


def _occluders(geometry: SceneGeometry, objects: tuple[int, ...], settings: BakeSettings) -> Occluders:
    vertices, triangles = geometry.vertices, geometry.triangles
    if len(objects) < len(geometry.placed):
        triangles = triangles[np.isin(geometry.objects, objects)]
    if settings.ground is not None:
        level = vertices[np.unique(geometry.triangles), "xyz".index(settings.ground)].min(initial=0)
        vertices, triangles = _with_ground(vertices, triangles, "xyz".index(settings.ground), level)
    normals = None
    if settings.faces != "count":
        a, b, c = triangle_corners(vertices, triangles)
        normals = column_major(unit(cross(b - a, c - a)), F)
    return Occluders(Tracer(vertices, triangles), ClusterTree(vertices, triangles), normals)


def _with_ground(
    vertices: NDArray[np.float32], triangles: NDArray[np.int32], up: int, lowest: np.float32
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """The triangles and a large square just below `lowest` on the axis `up`, facing up."""
    a, b = (up + 1) % 3, (up + 2) % 3
    square = np.empty((4, 3), F)
    square[:, up] = lowest - GROUND_GAP
    square[:, a] = [-GROUND_SIZE, GROUND_SIZE, GROUND_SIZE, -GROUND_SIZE]
    square[:, b] = [-GROUND_SIZE, -GROUND_SIZE, GROUND_SIZE, GROUND_SIZE]
    first = len(vertices)
    faces = np.array([[first, first + 1, first + 2], [first, first + 2, first + 3]], np.int32)
    return np.concatenate([vertices, square]), np.concatenate([triangles, faces])
