"""Planar polygons of more than three corners, prepared once for interpolation over the polygon."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Vectors, column_major, cross, dot, length, take_rows, unit
from illumcli.geometry.bounds import transformed_vertices
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.polygon_normals import area_vectors
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry
from illumcli.records import Record

FLATNESS = 2.0**-10
"""Greatest distance of corners from the Newell plane, as a share of the polygon's mean width.

A square folded along its diagonal by an angle f has its corners f / (4 sqrt 2) sides, a quarter of f mean
widths, off the plane. So folds of more than 2^-8 radians are not planar, and smaller ones change an image by
less than one step of 8 bits: Lambert's cosine changes by at most the angle.
"""
MIN_CORNER_AREA = 1 / 64
"""Share of a quad's area that every corner must cut off with its two neighbours, for inverse bilinear
coordinates.

The Jacobian of the bilinear map is 0 at a corner of 180 degrees, and coordinates are steep there.
"""
MAX_CORNERS = 128
"""Larger polygons are interpolated by triangles: time and memory of a hit are proportional to the corners."""
EQUAL_NORMALS = 1e-6
"""Unit normals whose components differ by at most this are equal: the difference is rounding."""
FLAT_NORMAL = 1e-3
"""A file's normal within this angle of its polygon's is the polygon's, written with few digits [rad]."""
SAME_AREA = 1e-6
"""Greatest relative difference between a simple polygon's area and the sum of its triangles' areas."""


class PlanarPolygons(Record):
    """The Q planar polygons of a scene that have 4 to `MAX_CORNERS` corners. Arrays are read-only.

    Corners of a polygon are consecutive, here and among the scene's corners.
    """

    row: NDArray[np.int32]  # (T,) polygon of each triangle, -1 where the triangle is interpolated alone
    first_corner: NDArray[np.int32]  # (Q,) corner number, among all stored, of each polygon's first corner
    starts: NDArray[np.int32]  # (Q + 1,) first row in `flat` of each polygon, and the end
    flat: NDArray[np.float64]  # (K, 2) corners in the plane, from their mean; the farthest lies at distance 1
    padded: NDArray[np.int16]  # (Q,) corners rounded up to a power of 2; 0 for clearly convex quads
    triangle: NDArray[np.int32]  # (K,) a triangle of the polygon, in which the corner has the weights
    u: NDArray[np.float32]  # (K,) of corner 1
    v: NDArray[np.float32]  # (K,) of corner 2
    vertex: NDArray[np.int32]  # (K,) vertex number of each corner
    normal: NDArray[np.float32]  # (Q, 3) unit Newell normal, on the side from which the corners run left

    def __post_init__(self) -> None:
        for array in vars(self).values():
            array.setflags(write=False)

    def __len__(self) -> int:
        return len(self.first_corner)


def planar_polygons(geometry: SceneGeometry, normals: CornerVectors | None = None) -> PlanarPolygons | None:
    """The planar polygons of a scene; None if there are none.

    Corners are those of the meshes in double precision, before they are rounded for Embree; those of shared
    meshes in a space of their own. Polygons that cross themselves, or have no area, are left out.

    Parameters
    ----------
    normals : CornerVectors, optional
        Given if only normals are interpolated. Polygons whose corners all have the polygon's own normal, such
        as those of a box, are then left out too.
    """
    first, size, points, vertices = _candidates(geometry)
    if not len(first):
        return None

    # Corners in the plane through their mean, along two axes across Newell's normal.
    starts = np.concatenate([[0], np.cumsum(size)])
    owner = np.repeat(np.arange(len(size)), size)
    centre = np.add.reduceat(points, starts[:-1], axis=0) / size[:, None]
    away = points - take_rows(centre, owner)
    reach = np.maximum.reduceat(length(away), starts[:-1])
    away = away / np.where(reach > 0, reach, 1)[owner][:, None]
    vectors = area_vectors(Mesh(away, np.arange(len(away), dtype=np.int32), starts.astype(np.int32)))
    area = length(vectors) / 2
    normal = unit(vectors)
    along = _across(normal)
    flat: NDArray[np.float64] = np.stack(
        [dot(away, take_rows(along, owner)), dot(away, take_rows(cross(normal, along), owner))], axis=1
    )

    # Which of them are flat, and covered exactly once by their triangles.
    off_plane = np.maximum.reduceat(np.abs(dot(away, take_rows(normal, owner))), starts[:-1])
    is_planar = (area > 0) & (off_plane <= FLATNESS * area / 2)
    triangle_row = _rows_of_triangles(geometry, first, size)
    triangle = np.flatnonzero(triangle_row >= 0)
    polygon = triangle_row[triangle]
    a, b, c = (flat[geometry.corners[triangle, k] - first[polygon] + starts[polygon]] for k in range(3))
    covered = np.bincount(polygon, np.abs(_turn(b - a, c - a)) / 2, len(size))
    is_planar &= np.abs(covered - area) <= SAME_AREA * area
    if normals is not None:
        is_planar &= ~_is_flat(normals, first, size, normal)
    if not is_planar.any():
        return None

    # Keep the planar ones, and renumber them.
    number = np.where(is_planar, np.cumsum(is_planar) - 1, -1)
    kept = is_planar[owner]
    size = size[is_planar]
    starts = np.concatenate([[0], np.cumsum(size)]).astype(np.int32)
    row = np.append(number, -1)[triangle_row].astype(np.int32)
    first, flat, vertices = first[is_planar].astype(np.int32), column_major(flat[kept]), vertices[kept]
    padded = np.where(
        (size == 4) & (_smallest_corner(flat, starts, size) > MIN_CORNER_AREA * area[is_planar]),
        0,
        2 ** np.ceil(np.log2(size)).astype(np.int64),
    )
    of_triangle, u, v = _corner_weights(geometry, row, first, starts, flat)
    normal = column_major(normal[is_planar], F)
    return PlanarPolygons(
        row, first, starts, flat, padded.astype(np.int16), of_triangle, u, v, vertices, normal
    )


def _candidates(geometry: SceneGeometry) -> tuple[NDArray[Any], NDArray[Any], Vectors, NDArray[np.int32]]:
    """Polygons that may be planar: first corner and size, (Q,) each; positions [radii], (K, 3), and vertices,
    (K,), of their corners."""
    firsts, sizes, positions, vertices = [], [], [np.zeros((0, 3))], [np.zeros(0, np.int32)]
    for placed in geometry.placed:
        mesh = placed.mesh
        if len(mesh.corners) == 3 * mesh.polygon_count:  # all have three: none has fewer
            continue
        size = np.diff(mesh.starts)
        which = np.flatnonzero((size > 3) & (size <= MAX_CORNERS))
        size, first = size[which].astype(np.int64), mesh.starts[which].astype(np.int64)
        corner = np.repeat(first - np.cumsum(size) + size, size) + np.arange(size.sum())
        vertex = mesh.corners[corner]
        firsts.append(first + placed.first_corner)
        sizes.append(size)
        positions.append(
            placed.space.from_world(take_rows(transformed_vertices(mesh, placed.matrix), vertex))
        )
        vertices.append(vertex + np.int32(placed.first_vertex))
    if not firsts:
        return np.zeros(0, np.int64), np.zeros(0, np.int64), positions[0], vertices[0]
    return (
        np.concatenate(firsts),
        np.concatenate(sizes),
        column_major(np.concatenate(positions)),
        np.concatenate(vertices),
    )


def _is_flat(
    normals: CornerVectors, first: NDArray[Any], size: NDArray[Any], normal: Vectors
) -> NDArray[np.bool_]:
    """(Q,) True for polygons whose corners all have one normal, the polygon's own."""
    starts = np.cumsum(size) - size
    corner = np.repeat(first - starts, size) + np.arange(size.sum())
    n = take_rows(normals.values, normals.index.take(corner))
    first_normal = take_rows(n, starts)
    difference = np.abs(n - take_rows(first_normal, np.repeat(np.arange(len(size)), size))).max(axis=1)
    is_own = np.abs(dot(first_normal, normal)) > 1 - FLAT_NORMAL**2 / 2
    return np.asarray((np.maximum.reduceat(difference, starts) <= EQUAL_NORMALS) & is_own)


def _across(normal: Vectors) -> Vectors:
    """(Q, 3) a unit vector perpendicular to each unit normal."""
    axis = np.zeros_like(normal)
    axis[np.arange(len(axis)), np.argmin(np.abs(normal), axis=1)] = 1
    return unit(cross(axis, normal))


def _turn(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) cross product of vectors in the plane, (N, 2) each."""
    product: NDArray[np.float64] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return product


def _rows_of_triangles(geometry: SceneGeometry, first: NDArray[Any], size: NDArray[Any]) -> NDArray[np.int64]:
    """(T,) index of each triangle's polygon among those with these ascending first corners, -1 for none."""
    corner = geometry.corners[:, 0]
    row = np.searchsorted(first, corner, side="right") - 1
    inside = (row >= 0) & (corner < (first + size)[row])
    return np.where(inside, row, -1)


def _smallest_corner(
    flat: NDArray[np.float64], starts: NDArray[np.int32], size: NDArray[Any]
) -> NDArray[np.float64]:
    """(Q,) the least of the areas that each polygon's first four corners cut off with their neighbours."""
    corner = [flat[starts[:-1] + k] for k in range(4)]
    cut = [_turn(corner[k - 3] - corner[k], corner[k - 1] - corner[k]) / 2 for k in range(4)]
    return np.minimum.reduce(cut)


def _corner_weights(
    geometry: SceneGeometry,
    row: NDArray[np.int32],
    first: NDArray[np.int32],
    starts: NDArray[np.int32],
    flat: NDArray[np.float64],
) -> tuple[NDArray[np.int32], NDArray[np.float32], NDArray[np.float32]]:
    """(K,) a triangle for each corner, and the weights of that triangle's corners 1 and 2 there.

    A corner that triangulation skipped, as on a straight edge, gets its weights in the plane of the polygon's
    first triangle.
    """
    # The first triangle of each polygon: written in reverse, so that it is written last.
    inside = np.flatnonzero(row >= 0)[::-1]
    first_triangle = np.zeros(len(first), np.int32)
    first_triangle[row[inside]] = inside
    triangle = np.repeat(first_triangle, np.diff(starts))

    # Corners that are a triangle's corner k.
    k_of_corner = np.full(len(flat), -1, np.int8)
    for k in range(3):
        corner = geometry.corners[inside, k] - first[row[inside]] + starts[row[inside]]
        triangle[corner], k_of_corner[corner] = inside, k
    u, v = (k_of_corner == 1).astype(np.float32), (k_of_corner == 2).astype(np.float32)

    # Corners that are in no triangle.
    if (skipped := np.flatnonzero(k_of_corner < 0)).size:
        nearest, polygon = triangle[skipped], row[triangle[skipped]]
        a, b, c = (flat[geometry.corners[nearest, k] - first[polygon] + starts[polygon]] for k in range(3))
        area = _turn(b - a, c - a)
        area = np.where(area == 0, 1, area)
        u[skipped] = _turn(flat[skipped] - a, c - a) / area
        v[skipped] = _turn(b - a, flat[skipped] - a) / area
    return triangle, u, v
