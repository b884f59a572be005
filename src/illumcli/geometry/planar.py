"""Planar polygons of more than three corners: what interpolation over a whole polygon needs, made once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Vectors, column_major, cross, dot, length, take_rows, unit
from illumcli.geometry.bounds import transformed_vertices
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.normals import area_vectors
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry
from illumcli.records import Record

FLATNESS = 2.0**-10
"""How far corners may lie off the Newell plane, as a share of the polygon's mean width.

A square folded along its diagonal by an angle f has its corners f / (4 sqrt 2) sides, a quarter of f mean
widths, off the plane. So no fold of more than 2^-8 radians passes as flat, and less is no step of an 8-bit
picture: Lambert's cosine changes by no more than the angle.
"""
CLEARLY_CONVEX = 1 / 64
"""Of a quad's area: what each corner cuts off with its two neighbours, for inverse bilinear coordinates.

The Jacobian of the bilinear map is 0 at a corner of 180 degrees, and coordinates are steep there.
"""
MOST_CORNERS = 128
"""Work and memory of a hit go with the corners of its polygon; larger ones are interpolated by triangles."""
ALIKE = 1e-6
"""By components: unit normals nearer than this are one, rounded."""
NEARLY_OWN = 1e-3
"""[rad] A normal nearer than this to its polygon's own is that one, in the digits of a file."""
SAME_AREA = 1e-6
"""Triangles of a simple polygon cover it once: their areas add up to its own but for this share."""


class PlanarPolygons(Record):
    """The Q planar polygons of a World that have 4 to `MOST_CORNERS` corners. Arrays are read-only.

    Corners of a polygon follow each other in the World's numbers, and here.
    """

    row: NDArray[np.int32]  # (T,) polygon of each triangle, -1 where the triangle is interpolated alone
    first_corner: NDArray[np.int32]  # (Q,) corner number, in the World, of each polygon's first corner
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
    """The planar polygons of a World; None where all is triangles.

    Corners are taken in double precision as the meshes have them, before they are rounded for the ray core.
    Polygons that cross themselves, or have no area, are left out.

    Parameters
    ----------
    normals : CornerVectors, optional
        Given where nothing but these is interpolated: polygons whose corners all have the polygon's own
        normal, as those of a box, are left out too.
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

    # Which of them are flat, and covered once by their triangles.
    off = np.maximum.reduceat(np.abs(dot(away, take_rows(normal, owner))), starts[:-1])
    is_planar = (area > 0) & (off <= FLATNESS * area / 2)
    triangle_row = _rows_of_triangles(geometry, first, size)
    mine = np.flatnonzero(triangle_row >= 0)
    own = triangle_row[mine]
    a, b, c = (flat[geometry.corners[mine, k] - first[own] + starts[own]] for k in range(3))
    covered = np.bincount(own, np.abs(_turn(b - a, c - a)) / 2, len(size))
    is_planar &= np.abs(covered - area) <= SAME_AREA * area
    if normals is not None:
        is_planar &= ~_is_flat(normals, first, size, normal)
    if not is_planar.any():
        return None

    # The planar ones alone.
    number = np.where(is_planar, np.cumsum(is_planar) - 1, -1)
    kept = is_planar[owner]
    size = size[is_planar]
    starts = np.concatenate([[0], np.cumsum(size)]).astype(np.int32)
    row = np.append(number, -1)[triangle_row].astype(np.int32)
    first, flat, vertices = first[is_planar].astype(np.int32), column_major(flat[kept]), vertices[kept]
    padded = np.where(
        (size == 4) & (_smallest_corner(flat, starts, size) > CLEARLY_CONVEX * area[is_planar]),
        0,
        2 ** np.ceil(np.log2(size)).astype(np.int64),
    )
    triangle, u, v = _places(geometry, row, first, starts, flat)
    normal = column_major(normal[is_planar], F)
    return PlanarPolygons(row, first, starts, flat, padded.astype(np.int16), triangle, u, v, vertices, normal)


def _candidates(geometry: SceneGeometry) -> tuple[NDArray[Any], NDArray[Any], Vectors, NDArray[np.int32]]:
    """First corner and size of polygons that may be planar; place, in radii, and vertex of their corners."""
    firsts, sizes, places, vertices = [], [], [np.zeros((0, 3))], [np.zeros(0, np.int32)]
    for placed in geometry.placed:
        mesh = placed.mesh
        if len(mesh.corners) == 3 * mesh.polygon_count:  # none has fewer
            continue
        size = np.diff(mesh.starts)
        which = np.flatnonzero((size > 3) & (size <= MOST_CORNERS))
        size, first = size[which].astype(np.int64), mesh.starts[which].astype(np.int64)
        corner = np.repeat(first - np.cumsum(size) + size, size) + np.arange(size.sum())
        vertex = mesh.corners[corner]
        firsts.append(first + placed.first_corner)
        sizes.append(size)
        places.append(
            geometry.render_space.from_world(take_rows(transformed_vertices(mesh, placed.matrix), vertex))
        )
        vertices.append(vertex + np.int32(placed.first_vertex))
    if not firsts:
        return np.zeros(0, np.int64), np.zeros(0, np.int64), places[0], vertices[0]
    return (
        np.concatenate(firsts),
        np.concatenate(sizes),
        column_major(np.concatenate(places)),
        np.concatenate(vertices),
    )


def _is_flat(
    normals: CornerVectors, first: NDArray[Any], size: NDArray[Any], normal: Vectors
) -> NDArray[np.bool_]:
    """(Q,) True for polygons whose corners all have one normal, the polygon's own."""
    starts = np.cumsum(size) - size
    corner = np.repeat(first - starts, size) + np.arange(size.sum())
    n = take_rows(normals.values, normals.index.take(corner))
    own = take_rows(n, starts)
    apart = np.abs(n - take_rows(own, np.repeat(np.arange(len(size)), size))).max(axis=1)
    upright = np.abs(dot(own, normal)) > 1 - NEARLY_OWN**2 / 2
    return np.asarray((np.maximum.reduceat(apart, starts) <= ALIKE) & upright)


def _across(normal: Vectors) -> Vectors:
    """(Q, 3) a unit vector at right angles to each unit normal."""
    axis = np.zeros_like(normal)
    axis[np.arange(len(axis)), np.argmin(np.abs(normal), axis=1)] = 1
    return unit(cross(axis, normal))


def _turn(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) cross product in the plane."""
    product: NDArray[np.float64] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return product


def _rows_of_triangles(geometry: SceneGeometry, first: NDArray[Any], size: NDArray[Any]) -> NDArray[np.int64]:
    """(T,) which of the polygons with these ascending first corners each triangle belongs to, -1 none."""
    corner = geometry.corners[:, 0]
    row = np.searchsorted(first, corner, side="right") - 1
    inside = (row >= 0) & (corner < (first + size)[row])
    return np.where(inside, row, -1)


def _smallest_corner(
    flat: NDArray[np.float64], starts: NDArray[np.int32], size: NDArray[Any]
) -> NDArray[np.float64]:
    """(Q,) of each polygon's first four corners, the least area that one cuts off with its neighbours."""
    corner = [flat[starts[:-1] + k] for k in range(4)]
    cut = [_turn(corner[k - 3] - corner[k], corner[k - 1] - corner[k]) / 2 for k in range(4)]
    return np.minimum.reduce(cut)


def _places(
    geometry: SceneGeometry,
    row: NDArray[np.int32],
    first: NDArray[np.int32],
    starts: NDArray[np.int32],
    flat: NDArray[np.float64],
) -> tuple[NDArray[np.int32], NDArray[np.float32], NDArray[np.float32]]:
    """(K,) a triangle for each corner, and the weights of its corners 1 and 2 there.

    A corner that the cut skipped, as on a straight edge, has its place on the plane of the first triangle.
    """
    mine = np.flatnonzero(row >= 0)[::-1]  # of several triangles the first is written last
    lowest = np.zeros(len(first), np.int32)
    lowest[row[mine]] = mine
    triangle = np.repeat(lowest, np.diff(starts))
    named = np.full(len(flat), -1, np.int8)
    for k in range(3):
        at = geometry.corners[mine, k] - first[row[mine]] + starts[row[mine]]
        triangle[at], named[at] = mine, k
    u, v = (named == 1).astype(np.float32), (named == 2).astype(np.float32)
    if (lost := np.flatnonzero(named < 0)).size:
        of, own = triangle[lost], row[triangle[lost]]
        a, b, c = (flat[geometry.corners[of, k] - first[own] + starts[own]] for k in range(3))
        whole = _turn(b - a, c - a)
        whole = np.where(whole == 0, 1, whole)
        u[lost] = _turn(flat[lost] - a, c - a) / whole
        v[lost] = _turn(b - a, flat[lost] - a) / whole
    return triangle, u, v
