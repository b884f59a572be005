"""Normals of polygons.

All work is in float64, on the corners of a block of polygons at once. Sums are formed from vectors that start
at the polygon's first corner, so a mesh far from the origin keeps its digits. Every polygon has at least
three corners.

References
----------
Sutherland, I. E., Sproull, R. F., Schumacker, R. A. (1974). A characterization of ten hidden-surface
    algorithms. ACM Computing Surveys 6. The Martin-Newell normal.
Theoharis, T. et al. (2008). Graphics and Visualization, eq. 12.31 to 12.33.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Vectors, column_major, cross, dot, length, take_rows, unit
from illumcli.geometry.mesh import Mesh

PolygonMethod: TypeAlias = Literal["cross", "edge_average", "newell", "plane"]

EPS = np.finfo(np.float64).eps
OPPOSITE = -0.01
"""Cosine below which a normal of the file clearly points to the other side of its polygon."""

BLOCK = 1 << 13
"""Polygons processed at once: their arrays fit into a processor's own cache, and a mesh of 10^7 triangles
needs no gigabytes for them."""

CornerIndex: TypeAlias = NDArray[np.int32] | slice
"""A corner of every polygon."""


def polygon_normals(mesh: Mesh, method: PolygonMethod = "newell") -> Vectors:
    """(P, 3) float64 unit normals, on the side from which the polygon runs counter-clockwise.

    Parameters
    ----------
    method : {"newell", "cross", "edge_average", "plane"}
        `newell` suits every polygon. The others are the textbook ones: `cross` of the edges at the first
        corner (on the wrong side where that corner is reflex), `edge_average` of the unit cross products at
        all corners, `plane` through the first three corners, on Newell's side. Where one of these is not
        defined (corners on a line), Newell's is used.

    Returns
    -------
    (P, 3) float64; zero for degenerate polygons: all corners on a line, to the precision of doubles.
    """
    return _in_blocks(mesh, partial(_polygon_normals, method))


def _polygon_normals(method: PolygonMethod, mesh: Mesh) -> Vectors:
    newell = unit(_area_vectors(mesh))
    if method == "newell":
        return newell
    first = mesh.starts[:-1]
    if method == "cross":
        normals = unit(take_rows(corner_crosses(mesh), first))
    elif method == "edge_average":
        normals = unit(_sum_per_polygon(unit(corner_crosses(mesh)), mesh.starts))
    else:
        a, b, fans = _fan_edges(mesh)
        normals = unit(cross(take_rows(a, fans[:-1]), take_rows(b, fans[:-1])))
        normals = normals * np.where(dot(normals, newell) < 0, -1.0, 1.0)[:, None]
    is_defined = dot(normals, normals) > 0
    return np.where((is_defined & (dot(newell, newell) > 0))[:, None], normals, newell)


def reversed_polygons(mesh: Mesh) -> NDArray[np.bool_] | None:
    """(P,) True for polygons that run clockwise seen from where the file's normals point; None if none does.

    At every corner the cosine between the file's normal and the polygon's own is below `OPPOSITE`. A polygon
    whose normals point to both sides, as on a card of foliage, keeps its side, and so does one that lacks
    normals.
    """
    if mesh.normals is None or mesh.corner_normals is None or not mesh.polygon_count:
        return None
    normals, is_valid = unit_file_normals(mesh.normals)
    out = np.empty(mesh.polygon_count, np.bool_)
    for polygons, corners, part in blocks(mesh):
        row = mesh.corner_normals[corners]
        cosine = dot(take_rows(normals, row), take_rows(polygon_normals(part), polygon_of_corners(part)))
        opposite = (cosine < OPPOSITE) & (row >= 0) & is_valid[row]
        np.logical_and.reduceat(opposite, part.starts[:-1], out=out[polygons])
    return out if out.any() else None


def unit_file_normals(normals: NDArray[np.float64]) -> tuple[Vectors, NDArray[np.bool_]]:
    """(K, 3) the normals of a file, normalised, and (K,) True for those that have a direction."""
    largest = np.abs(normals).max(axis=1, initial=0.0)
    is_valid = (largest > 0) & np.isfinite(largest)
    scaled = np.zeros_like(
        normals, order="F"
    )  # divided by the largest component, so that squares do not overflow
    np.divide(normals, largest[:, None], out=scaled, where=is_valid[:, None])
    return unit(scaled), is_valid


def area_vectors(mesh: Mesh) -> Vectors:
    """(P, 3) Newell's vectors: normals as long as twice the polygons' area; zero for degenerate polygons.

    The sum of the cross products of the fan from the first corner, which is Newell's sum with that corner as
    the origin. Also right for concave polygons.
    """
    return _in_blocks(mesh, _area_vectors)


def blocks(mesh: Mesh) -> Iterator[tuple[slice, slice, Mesh]]:
    """Consecutive polygons of a mesh: their numbers, those of their corners, and a mesh of them alone
    over the same vertices."""
    for first in range(0, mesh.polygon_count, BLOCK):
        starts = mesh.starts[first : first + BLOCK + 1]
        corners = slice(int(starts[0]), int(starts[-1]))
        part = Mesh(mesh.vertices, mesh.corners[corners], starts - starts[0])
        yield slice(first, first + part.polygon_count), corners, part


def polygon_of_corners(mesh: Mesh) -> NDArray[np.int32]:
    """(C,) the polygon that each corner belongs to."""
    return np.repeat(np.arange(mesh.polygon_count, dtype=np.int32), np.diff(mesh.starts))


def _in_blocks(mesh: Mesh, of_polygons: Callable[[Mesh], Vectors]) -> Vectors:
    """(P, 3) float64 results of a function for all polygons, called block by block."""
    if mesh.polygon_count <= BLOCK:
        return of_polygons(mesh)
    out = np.empty((mesh.polygon_count, 3), order="F")
    for polygons, _, part in blocks(mesh):
        out[polygons] = of_polygons(part)
    return out


def _area_vectors(mesh: Mesh) -> Vectors:
    a, b, fans = _fan_edges(mesh)
    vectors = _sum_per_polygon(cross(a, b), fans)
    rounding = 4 * EPS * _sum_per_polygon(dot(a, a) + dot(b, b), fans)
    return vectors * (length(vectors) > rounding)[:, None]


def corner_crosses(mesh: Mesh) -> Vectors:
    """(C, 3) cross product of the edges that leave each corner, next x previous, not normalised.

    Outward at a convex corner of a counter-clockwise polygon, the other way at a reflex one.
    """
    following, previous = corner_edges(mesh)
    return cross(following, previous)


def corner_edges(mesh: Mesh) -> tuple[Vectors, Vectors]:
    """(C, 3) from each corner to the next, and to the previous one, of its polygon."""
    points = _corner_points(mesh)
    first, last = _first_and_last(mesh)
    following, previous = np.empty_like(points), np.empty_like(points)
    for p, ahead, back in zip(points.T, following.T, previous.T, strict=True):
        # Differences of consecutive corners, then the edges that close the polygons.
        np.subtract(p[1:], p[:-1], out=ahead[:-1])
        ahead[last] = p[first] - p[last]
        np.negative(ahead[:-1], out=back[1:])
        back[first] = -ahead[last]
    return following, previous


def _corner_points(mesh: Mesh) -> NDArray[np.float64]:
    """(C, 3) position of each corner, components contiguous."""
    return column_major(mesh.vertices.take(mesh.corners, axis=0))


def _first_and_last(mesh: Mesh) -> tuple[CornerIndex, CornerIndex]:
    """Index of the first and last corner of every polygon; slices if all have equally many corners."""
    size = np.diff(mesh.starts)
    if len(size) and (size == size[0]).all():
        return slice(0, None, int(size[0])), slice(int(size[0]) - 1, None, int(size[0]))
    return mesh.starts[:-1], mesh.starts[1:] - 1


def _fan_edges(mesh: Mesh) -> tuple[Vectors, Vectors, NDArray[np.integer[Any]]]:
    """Edges of the triangles of each polygon's fan around its first corner.

    Returns
    -------
    a, b : (F, 3) float64
        From the first corner to the other two of each triangle.
    fans : (P + 1,) int
        First triangle of each polygon, and the end.
    """
    count = np.maximum(np.diff(mesh.starts) - 2, 0)
    fans = np.concatenate([[0], np.cumsum(count)])
    if (count == 1).all():
        points = mesh.vertices.take(mesh.corners, axis=0)
        origin, second, third = (column_major(points[k::3]) for k in range(3))
    else:
        points = _corner_points(mesh)
        corner = np.arange(fans[-1]) - np.repeat(fans[:-1] - mesh.starts[:-1] - 1, count)
        origin, second, third = (
            take_rows(points, np.repeat(mesh.starts[:-1], count)),
            take_rows(points, corner),
            take_rows(points, corner + 1),
        )
    return second - origin, third - origin, fans


def _sum_per_polygon(values: NDArray[Any], starts: NDArray[np.integer[Any]]) -> NDArray[Any]:
    """(P, ...) sums of the values between successive `starts`; 0 where there are none."""
    if len(values) == len(starts) - 1 and (np.diff(starts) == 1).all():
        return values
    out = np.zeros((len(starts) - 1, *values.shape[1:]), values.dtype, order="F")
    has_any = np.diff(starts) > 0
    if has_any.any():
        out[has_any] = np.add.reduceat(values, starts[:-1][has_any], axis=0)
    return out
