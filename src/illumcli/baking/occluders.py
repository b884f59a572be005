"""The geometry that may occlude the points of each object of a bake."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, column_major, cross, unit
from illumcli.baking.ground import Ground
from illumcli.baking.occluder_choice import OccluderChoice, occluder_choices
from illumcli.baking.settings import BakeSettings
from illumcli.geometry.scene_geometry import SceneGeometry, triangle_corners
from illumcli.rays.embree import Tracer
from illumcli.records import Record
from illumcli.visibility.open_hemisphere import ClusterTree


class OccludingMesh(Record):
    """The meshes of a file in their places, which occlude and are not baked."""

    vertices: NDArray[np.float64]  # (V, 3) [scene units]
    triangles: NDArray[np.int32]  # (T, 3)

    @classmethod
    def of(cls, geometry: SceneGeometry) -> OccludingMesh:
        """All triangles of the geometry of a file."""
        vertices = [
            placed.mesh.vertices @ placed.matrix[:3, :3].T + placed.matrix[:3, 3]
            for placed in geometry.placed
        ]
        return cls(np.concatenate([np.zeros((0, 3)), *vertices]), geometry.triangles)


class Occluders(Record):
    """Triangles that occlude the points of an object."""

    tracer: Tracer
    clusters: ClusterTree
    normals: NDArray[np.float32] | None = None  # (T, 3) unit; None if back faces occlude


def occluders_of(
    names: Sequence[str],
    geometry: SceneGeometry,
    settings: BakeSettings,
    files: Mapping[Path, OccludingMesh],
) -> list[Occluders]:
    """Occluders of each object, by its name.

    Raises
    ------
    InputError
        A text of `settings.occluders` names nothing, or two things.
    """
    built: dict[OccluderChoice, Occluders] = {}
    occluders = []
    for choice in occluder_choices(settings.occluders, names):
        if choice not in built:
            built[choice] = _occluders(geometry, choice, settings, files)
        occluders.append(built[choice])
    return occluders


def _occluders(
    geometry: SceneGeometry,
    choice: OccluderChoice,
    settings: BakeSettings,
    files: Mapping[Path, OccludingMesh],
) -> Occluders:
    space = geometry.render_space
    vertices, triangles = [geometry.vertices], [geometry.triangles]
    if len(choice.objects) < len(geometry.placed):
        triangles = [geometry.triangles[np.isin(geometry.objects, choice.objects)]]
    for path in choice.files:
        vertices.append(space.from_world(files[path].vertices).astype(F))
        triangles.append(files[path].triangles)
    if settings.ground is not None:
        used = geometry.vertices[np.unique(geometry.triangles)]
        vertices.append(Ground.of(settings.ground).square(used, space.radius))
        triangles.append(np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    return _built(vertices, triangles, settings.faces != "count")


def _built(
    vertices: Sequence[NDArray[np.float32]], triangles: Sequence[NDArray[np.int32]], with_normals: bool
) -> Occluders:
    """The occluders of several meshes."""
    first = np.cumsum([0, *(len(each) for each in vertices)])
    every = np.concatenate(vertices)
    index = np.concatenate([each + np.int32(k) for each, k in zip(triangles, first[:-1], strict=True)])
    normals = None
    if with_normals:
        a, b, c = triangle_corners(every, index)
        normals = column_major(unit(cross(b - a, c - a)), F)
    return Occluders(Tracer(every, index), ClusterTree(every, index), normals)
