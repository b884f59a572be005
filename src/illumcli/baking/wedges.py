"""Wedges: the parts of triangles next to each polygon corner, with their angles.

The rays of a vertex are divided among its wedges by angle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, column_major, cross, dot, length, take_rows
from illumcli.baking.work import in_blocks
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
    vertex: NDArray[np.int32]  # (K, 3) of the corner, of the next one and of the previous one, by columns
    angle: NDArray[np.float64]  # (K,) at the corner [rad]


def polygon_corners(geometry: SceneGeometry) -> PolygonCorners:
    """The corners of all polygons of the scene."""
    vertex = [placed.mesh.corners + np.int32(placed.first_vertex) for placed in geometry.placed]
    starts = [placed.mesh.starts[1:] + np.int64(placed.first_corner) for placed in geometry.placed]
    return PolygonCorners(
        np.concatenate([np.zeros(0, np.int32), *vertex]), np.concatenate([np.zeros(1, np.int64), *starts])
    )


def triangles_of(geometry: SceneGeometry, threads: int = 1) -> Triangles:
    """Normal, edge, height and area of every triangle of the scene."""
    count = len(geometry.triangles)
    out = Triangles(np.empty((count, 3), F, order="F"), *(np.empty(count, F) for _ in range(3)))

    def compute(rows: slice) -> None:
        of = np.arange(rows.start, rows.stop, dtype=np.int32)
        zero = np.zeros(len(of), F)
        interaction = interact(geometry, geometry.objects[rows], of, zero, zero, np.zeros((len(of), 3), F))
        corner = triangle_corners(geometry.vertices, geometry.triangles[rows])
        edges = [corner[k - 2] - corner[k] for k in range(3)]
        area = length(cross(edges[0], edges[1]))
        longest = np.maximum.reduce([length(edge) for edge in edges])
        out.ng[rows], out.edge[rows], out.area[rows] = interaction.ng, interaction.edge, area
        out.height[rows] = np.divide(area, longest, out=np.zeros_like(area), where=longest > 0)

    in_blocks(compute, count, threads)
    return out


def corner_wedges(
    geometry: SceneGeometry, polygons: PolygonCorners, triangles: Triangles, threads: int = 1
) -> CornerWedges:
    """The wedges of all corners.

    A triangle has one at each of its corners. A corner whose triangles all have area 0, because its polygon
    was cut there, has one wedge: its polygon's angle, on the polygon's largest triangle.
    """
    # corners of triangles that have an area
    ng, area = triangles.ng, triangles.area
    sound = np.flatnonzero(area > 0)
    owner = take_rows(geometry.corners, sound).T.ravel().astype(np.int64)
    of = np.tile(sound.astype(np.int32), 3)
    vertices, angle = _wedges_of_triangles(geometry, ng, sound, threads)

    # corners without such a triangle, in polygons that have one
    without = np.ones(len(polygons.vertex), bool)
    without[owner] = False
    if not without.any():
        return CornerWedges(owner, of, vertices, angle)
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
        vertices = np.concatenate([vertices.T, more.T], axis=1).T
        corner, ahead, back = (_positions(geometry, more[:, k]) for k in range(3))
        angle = np.concatenate([angle, _angles(ahead - corner, back - corner, take_rows(ng, carrier))])
    return CornerWedges(owner, of, vertices, angle)


def _wedges_of_triangles(
    geometry: SceneGeometry, ng: Vectors, sound: NDArray[np.int64], threads: int
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Vertices, (3 T, 3), and angles, (3 T,), of the wedges of T triangles; those at corner 0 come first."""
    count = len(sound)
    vertices, angle = np.empty((3 * count, 3), np.int32, order="F"), np.empty(3 * count)

    def compute(rows: slice) -> None:
        triangle, normal = take_rows(geometry.triangles, sound[rows]), take_rows(ng, sound[rows])
        corner = [_positions(geometry, triangle[:, k]) for k in range(3)]
        edges = [corner[k - 2] - corner[k] for k in range(3)]
        for k in range(3):
            wedge = slice(k * count + rows.start, k * count + rows.stop)
            for column in range(3):
                vertices[wedge, column] = triangle[:, (k + column) % 3]
            angle[wedge] = _angles(edges[k], -edges[k - 1], normal)

    in_blocks(compute, count, threads)
    return vertices, angle


def _positions(geometry: SceneGeometry, vertex: NDArray[np.int32]) -> NDArray[np.float64]:
    """(K, 3) positions of vertices."""
    return column_major(take_rows(geometry.vertices, vertex), np.float64)


def _angles(ahead: NDArray[np.float64], back: NDArray[np.float64], ng: Vectors) -> NDArray[np.float64]:
    """(K,) angle from one edge to the other about `ng`, in (0, 2 pi) [rad]."""
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
