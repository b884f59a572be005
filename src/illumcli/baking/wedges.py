"""Wedges: the parts of triangles next to each polygon corner, with their angles.

The rays of a vertex are divided among its wedges by angle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, column_major, cross, dot, length, take_rows
from illumcli.geometry.scene_geometry import SceneGeometry, triangle_corners
from illumcli.rays.interaction import interact
from illumcli.records import Record


class Triangles(Record):
    """What ray origins need to know of each of T triangles, float32; all 0 where the area is 0."""

    ng: Vectors  # (T, 3) unit
    edge: Floats  # (T,) longest edge, longer for slivers (`offsets.effective_edge`), in radii
    height: Floats  # (T,) the least of the three, in radii
    area: Floats  # (T,) twice the area, in radii^2


class PolygonCorners(Record):
    """The corners of all polygons, object after object."""

    vertex: NDArray[np.int32]  # (C,) vertex of each corner
    starts: NDArray[np.int64]  # (P + 1,) first corner of each polygon, and the end


class CornerWedges(Record):
    """K wedges in the order of their triangles."""

    corner: NDArray[np.int64]  # (K,)
    triangle: Ids  # (K,)
    vertex: NDArray[np.int32]  # (K, 3) of the corner, of the next one and of the previous one
    angle: NDArray[np.float64]  # (K,) at the corner [rad]


def polygon_corners(geometry: SceneGeometry) -> PolygonCorners:
    """The corners of all polygons of the scene."""
    vertex = [placed.mesh.corners + np.int32(placed.first_vertex) for placed in geometry.placed]
    starts = [placed.mesh.starts[1:] + np.int64(placed.first_corner) for placed in geometry.placed]
    return PolygonCorners(
        np.concatenate([np.zeros(0, np.int32), *vertex]), np.concatenate([np.zeros(1, np.int64), *starts])
    )


def triangles_of(geometry: SceneGeometry) -> Triangles:
    """Normal, edge, height and area of every triangle of the scene."""
    every = np.arange(len(geometry.triangles), dtype=np.int32)
    zero = np.zeros(len(every), F)
    interaction = interact(geometry, geometry.objects, every, zero, zero, np.zeros((len(every), 3), F))
    corner = triangle_corners(geometry.vertices, geometry.triangles)
    edges = [corner[k - 2] - corner[k] for k in range(3)]
    area = length(cross(edges[0], edges[1]))
    longest = np.maximum.reduce([length(edge) for edge in edges])
    height = np.divide(area, longest, out=np.zeros_like(area), where=longest > 0)
    return Triangles(interaction.ng, interaction.edge, height.astype(F), area.astype(F))


def corner_wedges(geometry: SceneGeometry, polygons: PolygonCorners, triangles: Triangles) -> CornerWedges:
    """The wedges of all corners.

    A triangle has one at each of its corners. A corner whose triangles all have area 0, because its polygon
    was cut there, has one wedge: its polygon's angle, on the polygon's largest triangle.
    """
    # corners of triangles that have an area
    ng, area = triangles.ng, triangles.area
    sound = np.flatnonzero(area > 0)
    triangle, corner = geometry.triangles[sound], geometry.corners[sound]
    rotated = [np.roll(triangle, -k, axis=1) for k in range(3)]
    vertices = np.concatenate(rotated) if len(sound) else np.zeros((0, 3), np.int32)
    owner = np.concatenate([corner[:, k] for k in range(3)]).astype(np.int64)
    of = np.tile(sound.astype(np.int32), 3)
    angle = np.concatenate([_angles(geometry, each, take_rows(ng, sound)) for each in rotated])

    # corners without such a triangle, in polygons that have one
    without = np.ones(len(polygons.vertex), bool)
    without[owner] = False
    largest = np.full(len(polygons.starts) - 1, -1, np.int64)
    by_area = sound[np.argsort(area[sound], kind="stable")]
    largest[geometry.polygons[by_area]] = by_area
    polygon = np.repeat(np.arange(len(polygons.starts) - 1), np.diff(polygons.starts))
    lone = np.flatnonzero(without & (largest[polygon] >= 0))
    if lone.size:
        # their wedges reach to the nearest corners of the polygon that lie at another place
        ends = [_distinct_neighbour(geometry, polygons, polygon[lone], lone, step) for step in (1, -1)]
        carrier = largest[polygon[lone]].astype(np.int32)
        more = np.stack([polygons.vertex[each] for each in (lone, *ends)], axis=1)
        forwards = _runs_forwards(geometry, carrier, polygons.starts, polygon[lone])
        more[~forwards] = more[~forwards][:, [0, 2, 1]]
        owner, of = np.concatenate([owner, lone]), np.concatenate([of, carrier])
        vertices = np.concatenate([vertices, more])
        angle = np.concatenate([angle, _angles(geometry, more, take_rows(ng, carrier))])
    return CornerWedges(owner, of, vertices, angle)


def _angles(geometry: SceneGeometry, vertex: NDArray[np.int32], ng: Vectors) -> NDArray[np.float64]:
    """(K,) angle at the corner from the next vertex to the previous one about `ng`, in (0, 2 pi) [rad]."""
    corner, following, last = (
        column_major(take_rows(geometry.vertices, vertex[:, k]), np.float64) for k in range(3)
    )
    ahead, back = following - corner, last - corner
    angle: NDArray[np.float64] = np.arctan2(dot(cross(ahead, back), ng.astype(np.float64)), dot(ahead, back))
    return np.maximum(np.where(angle < -1e-6, angle + 2 * np.pi, angle), 1e-6)


def _distinct_neighbour(
    geometry: SceneGeometry,
    polygons: PolygonCorners,
    polygon: NDArray[np.int64],
    corner: NDArray[np.int64],
    step: int,
) -> NDArray[np.int64]:
    """(K,) the nearest corner of the same polygon that lies at another place, forwards (`step` 1) or
    backwards (-1)."""
    vertices, vertex = geometry.vertices, polygons.vertex
    first = polygons.starts[polygon]
    size = polygons.starts[polygon + 1] - first
    neighbour = first + (corner - first + step) % size
    for _ in range(int(size.max(initial=0))):
        same = (vertices[vertex[neighbour]] == vertices[vertex[corner]]).all(axis=1)
        if not same.any():
            break
        neighbour = np.where(same, first + (neighbour - first + step) % size, neighbour)
    return neighbour


def _runs_forwards(
    geometry: SceneGeometry, triangle: Ids, starts: NDArray[np.int64], polygon: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """(K,) True where a triangle's corners follow each other as those of its polygon, False where the object
    is mirrored and they run the other way round."""
    a, b, c = (geometry.corners[triangle, k] - starts[polygon] for k in range(3))
    return ((a < b) & (b < c)) | ((b < c) & (c < a)) | ((c < a) & (a < b))
