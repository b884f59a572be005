"""Interpolation weights of a polygon's corners at a hit; every interpolation of corner values uses them.

Triangles have barycentric weights. Planar polygons of more corners are interpolated over the whole polygon,
so that nothing depends on their triangulation: clearly convex quads by inverse bilinear coordinates, all
others by mean value coordinates. On an edge both are linear between its ends, as barycentric weights are, so
values are continuous across polygons.

References
----------
Floater, M. S. (2003). Mean value coordinates. Computer Aided Geometric Design 20(1).
Hormann, K., Floater, M. S. (2006). Mean value coordinates for arbitrary planar polygons. ACM TOG 25(4).
Quilez, I. (2010). Inverse bilinear interpolation. The quadratic equation of a quad.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, take_rows
from illumcli.geometry.planar import PlanarPolygons
from illumcli.geometry.scene_geometry import CornerVectors, PolygonCentres, SceneGeometry
from illumcli.records import Record

BLOCK = 1 << 15
"""Corners per batch of mean value coordinates; a batch fits into a core's cache."""
TINY = 1e-12
"""A hit closer than this to an edge or corner counts as on it [radii of the polygon]."""
BELOW = -1e-6
"""A weight below this counts as negative: beyond the rounding of a hit across an edge."""


class Corners(Record):
    """Hits on polygons of one kind, and the weight of each corner there."""

    index: Ids | None  # (m,) indices among the M hits, ascending; None: all of them
    objects: Ids  # (m,) object of each hit

    @property
    def count(self) -> int:
        """Corners per hit."""
        raise NotImplementedError

    def weight(self, k: int) -> Floats:
        """(m,) weight of corner k."""
        raise NotImplementedError

    def end_weight(self, k: int) -> Floats:
        """(m,) weight of corner k as the end of an edge."""
        return self.weight(k)

    def corner(self, geometry: SceneGeometry, k: int) -> Ids:
        """(m,) number of corner k among those that are stored."""
        raise NotImplementedError

    def vertex(self, geometry: SceneGeometry, k: int) -> Ids:
        """(m,) number of its vertex."""
        raise NotImplementedError

    def position(self, geometry: SceneGeometry, k: int) -> Vectors:
        """(m, 3) position of corner k [radii]."""
        return geometry.positions(self.objects, take_rows(geometry.vertices, self.vertex(geometry, k)))

    def normal(self, geometry: SceneGeometry, normals: CornerVectors, k: int) -> Vectors:
        """(m, 3) unit shading normal at corner k."""
        n = take_rows(normals.values, normals.index.take(self.corner(geometry, k)))
        return geometry.unit_normals(self.objects, n)

    @property
    def shape(self) -> Ids:
        """(m,) the triangle or polygon that each hit lies on."""
        raise NotImplementedError

    def corner_on_triangle(self, k: int) -> tuple[Ids, Floats, Floats]:
        """(m,) each: a triangle that has corner k, and the corner's barycentric u and v there."""
        raise NotImplementedError

    def take(self, hits: NDArray[Any], new_index: Ids) -> Corners:
        """The group restricted to some hits.

        Parameters
        ----------
        hits : (K,)
            The hits to keep, ascending.
        new_index : (M,) int32
            The index of each hit among those kept, -1 for the others.
        """
        raise NotImplementedError

    def mean(self, values: Callable[[int], NDArray[Any]]) -> NDArray[Any]:
        """(m, j) weighted means of the values at the corners; ``values(k)`` gives those at corner k."""
        total = self.weight(0)[:, None] * values(0)
        for k in range(1, self.count):
            total = total + self.weight(k)[:, None] * values(k)
        return np.asarray(total)


class TriangleCorners(Corners):
    """Barycentric weights."""

    triangle: Ids  # (m,)
    u: Floats  # (m,) float32 weight of corner 1
    v: Floats  # (m,) float32 weight of corner 2

    @property
    def count(self) -> int:
        return 3

    def weight(self, k: int) -> Floats:
        return (self.u, self.v)[k - 1] if k else 1 - self.u - self.v

    def corner(self, geometry: SceneGeometry, k: int) -> Ids:
        return geometry.corners[:, k].take(self.triangle)

    def vertex(self, geometry: SceneGeometry, k: int) -> Ids:
        return geometry.triangles[:, k].take(self.triangle)

    @property
    def shape(self) -> Ids:
        return self.triangle

    def corner_on_triangle(self, k: int) -> tuple[Ids, Floats, Floats]:
        return self.triangle, np.full_like(self.u, k == 1), np.full_like(self.v, k == 2)

    def take(self, hits: NDArray[Any], new_index: Ids) -> TriangleCorners:
        kept = hits if self.index is None else np.flatnonzero(new_index.take(self.index) >= 0)
        index = None if self.index is None else new_index.take(self.index.take(kept))
        return self.at(kept, index)

    def at(self, which: NDArray[Any], index: Ids | None) -> TriangleCorners:
        """Some of the hits, with new indices."""
        objects, triangle = self.objects.take(which), self.triangle.take(which)
        return TriangleCorners(index, objects, triangle, self.u.take(which), self.v.take(which))


class PolygonCorners(Corners):
    """Weights over planar polygons. A polygon with fewer corners than the group's largest repeats its first
    corner with weight 0."""

    planar: PlanarPolygons
    polygon: Ids  # (m,) row of `planar`
    last: Ids  # (m,) corners less 1
    weights: NDArray[np.floating[Any]]  # (n, m) sum to 1; may be negative in concave polygons
    outside: NDArray[np.bool_]  # (m,) some weight is negative

    @property
    def count(self) -> int:
        return len(self.weights)

    def weight(self, k: int) -> Floats:
        weight: Floats = self.weights[k]
        return weight

    def end_weight(self, k: int) -> Floats:
        """(m,) weight of corner k; beyond the last corner that of the first, where the last edge ends."""
        return np.where(self.last < k, self.weights[0], self.weights[k])

    def number(self, first: NDArray[np.int32], k: int) -> Ids:
        """(m,) number of corner k, if the corners of polygon q are numbered from ``first[q]`` on."""
        return first.take(self.polygon) + np.where(self.last < k, np.int32(0), np.int32(k))

    def corner(self, geometry: SceneGeometry, k: int) -> Ids:
        return self.number(self.planar.first_corner, k)

    def vertex(self, geometry: SceneGeometry, k: int) -> Ids:
        return self.planar.vertex.take(self.number(self.planar.starts, k))

    @property
    def shape(self) -> Ids:
        return self.polygon

    def corner_on_triangle(self, k: int) -> tuple[Ids, Floats, Floats]:
        number = self.number(self.planar.starts, k)
        return self.planar.triangle.take(number), self.planar.u.take(number), self.planar.v.take(number)

    def take(self, hits: NDArray[Any], new_index: Ids) -> PolygonCorners:
        assert self.index is not None
        kept = np.flatnonzero(new_index.take(self.index) >= 0)
        return PolygonCorners(
            new_index.take(self.index.take(kept)),
            self.objects.take(kept),
            self.planar,
            self.polygon.take(kept),
            self.last.take(kept),
            self.weights[:, kept],
            self.outside.take(kept),
        )

    def mean(self, values: Callable[[int], NDArray[Any]]) -> NDArray[Any]:
        """(m, j) weighted means, clamped to the range of the corners' values where a weight is negative."""
        total = super().mean(values)
        outside = np.flatnonzero(self.outside)
        if outside.size:
            low = high = take_rows(values(0), outside)
            for k in range(1, self.count):
                at_corner = take_rows(values(k), outside)
                low, high = np.minimum(low, at_corner), np.maximum(high, at_corner)
            total[outside] = np.clip(total[outside], low, high)
        return total


class MeanCorners(Corners):
    """One point per polygon, at the mean of its corners."""

    centres: PolygonCentres
    polygon: Ids  # (m,) polygon number

    @property
    def count(self) -> int:
        return int(self._last().max(initial=0)) + 1

    def _last(self) -> Ids:
        return np.diff(self.centres.starts).take(self.polygon) - np.int32(1)

    def weight(self, k: int) -> Floats:
        last = self._last()
        return np.where(k <= last, 1 / (last + 1), 0).astype(F)

    def corner(self, geometry: SceneGeometry, k: int) -> Ids:
        return np.asarray(self.centres.starts.take(self.polygon) + np.minimum(self._last(), np.int32(k)))

    def vertex(self, geometry: SceneGeometry, k: int) -> Ids:
        return self.centres.vertex.take(self.corner(geometry, k))

    def take(self, hits: NDArray[Any], new_index: Ids) -> MeanCorners:
        kept = hits if self.index is None else np.flatnonzero(new_index.take(self.index) >= 0)
        index = None if self.index is None else new_index.take(self.index.take(kept))
        return MeanCorners(index, self.objects.take(kept), self.centres, self.polygon.take(kept))


class CornerWeights(Record):
    """The weights of the corners of the polygon at each of M hits, computed by `corner_weights`.

    Every interpolation goes through here: `interpolate` for vectors at corners, `interpolate_normals`,
    `interpolate_vertices` for values at vertices (colours, baked obscurance), `weighted_mean` for any
    function of a group and a corner k.
    """

    hits: TriangleCorners
    """All M hits with barycentric weights on their triangles."""
    groups: tuple[Corners, ...]
    """The hits by kind of polygon; each hit is in one group."""

    def __len__(self) -> int:
        return len(self.hits.triangle)

    @property
    def by_triangle(self) -> TriangleCorners | None:
        """The hits, if all of them are interpolated within their triangles."""
        first = self.groups[0] if len(self.groups) == 1 else None
        return first if isinstance(first, TriangleCorners) and first.index is None else None

    def interpolate(self, geometry: SceneGeometry, table: CornerVectors) -> NDArray[Any]:
        """(M, j) the vectors that `table` has at corners, interpolated as they are stored; not normalized."""
        return self.weighted_mean(
            lambda group, k: take_rows(table.values, table.index.take(group.corner(geometry, k)))
        )

    def interpolate_normals(self, geometry: SceneGeometry, normals: CornerVectors) -> Vectors:
        """(M, 3) shading normals at corners, in render space, interpolated; not normalized."""
        return self.weighted_mean(lambda group, k: group.normal(geometry, normals, k))

    def interpolate_vertices(self, geometry: SceneGeometry, values: NDArray[Any]) -> NDArray[Any]:
        """(M, j) interpolated values; `values` holds those at the vertices of the scene, (V, j)."""
        return self.weighted_mean(lambda group, k: take_rows(values, group.vertex(geometry, k)))

    def weighted_mean(self, values: Callable[[Any, int], NDArray[Any]]) -> NDArray[Any]:
        """(M, j) weighted means; ``values(group, k)`` gives (m, j) values at corner k of a group."""
        if len(self.groups) == 1 and self.groups[0].index is None:
            return self.groups[0].mean(partial(values, self.groups[0]))
        means = [group.mean(partial(values, group)) for group in self.groups]
        out = np.empty((len(self), means[0].shape[1]), F, order="F")
        for group, mean in zip(self.groups, means, strict=True):
            out[group.index] = mean
        return out

    def take(self, hits: NDArray[Any]) -> CornerWeights:
        """The weights at some of the hits, given by ascending indices."""
        if len(hits) == len(self):
            return self
        new_index = np.full(len(self), -1, np.int32)
        new_index[hits] = np.arange(len(hits), dtype=np.int32)
        groups = tuple(group.take(hits, new_index) for group in self.groups)
        return CornerWeights(self.hits.take(hits, new_index), groups)


def concatenated(parts: Sequence[CornerWeights]) -> CornerWeights:
    """The hits of all parts, one part after the other."""
    groups: list[Corners] = []
    count = 0
    for part in parts:
        for group in part.groups:
            index = np.arange(len(part), dtype=np.int32) if group.index is None else group.index
            groups.append(replace(group, index=index + np.int32(count)))
        count += len(part)
    objects, triangle, u, v = (
        np.concatenate([getattr(part.hits, name) for part in parts])
        for name in ("objects", "triangle", "u", "v")
    )
    return CornerWeights(TriangleCorners(None, objects, triangle, u, v), tuple(groups))


class OnTriangles(Protocol):
    """Points on triangles by barycentric weights: hits, shading points."""

    @property
    def objects(self) -> Ids:
        """(M,) int32 object numbers."""

    @property
    def triangle(self) -> Ids:
        """(M,) int32 stored triangles."""

    @property
    def u(self) -> Floats:
        """(M,) float32 weight of corner 1."""

    @property
    def v(self) -> Floats:
        """(M,) float32 weight of corner 2."""


def corner_weights(
    geometry: SceneGeometry, hits: OnTriangles, planar_polygons: PlanarPolygons | None = None
) -> CornerWeights:
    """The weights at M hits: over planar polygons if these are given, otherwise over triangles."""
    objects, triangle, u, v = hits.objects, hits.triangle, hits.u, hits.v
    by_triangle = TriangleCorners(None, objects, triangle, u, v)
    planar = planar_polygons
    if planar is None:
        return CornerWeights(by_triangle, (by_triangle,))

    # Hits on polygons that are not planar keep barycentric weights.
    row = planar.row.take(triangle)
    uneven = np.flatnonzero(row < 0).astype(np.int32)
    groups: list[Corners] = [by_triangle.at(uneven, uneven)]

    # The others are grouped by the number of corners: quads (0) by bilinear, larger polygons by mean value
    # coordinates.
    padded = planar.padded.take(row)
    padded[uneven] = -1
    for size in np.flatnonzero(np.bincount(planar.padded)):
        index = np.flatnonzero(padded == size).astype(np.int32)
        polygon = row.take(index)
        start = planar.starts.take(polygon)
        last = planar.starts.take(polygon + 1) - start - 1
        x, y = _in_plane(geometry, planar, triangle.take(index), u.take(index), v.take(index))
        if size:
            weights: NDArray[Any] = _mean_value(planar.flat, start, last, int(size), x, y)
        else:
            weights = _bilinear([take_rows(planar.flat, start + k) for k in range(4)], x, y)
        outside = np.any(weights < BELOW, axis=0)
        groups.append(PolygonCorners(index, objects.take(index), planar, polygon, last, weights, outside))
    not_empty = tuple(group for group in groups if group.index is not None and group.index.size)
    return CornerWeights(by_triangle, not_empty or tuple(groups[:1]))


def _in_plane(
    geometry: SceneGeometry, planar: PlanarPolygons, triangle: Ids, u: Floats, v: Floats
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(m,) coordinates of hits in the planes of their polygons, in double precision."""
    polygon = planar.row.take(triangle)
    shift = planar.starts.take(polygon) - planar.first_corner.take(polygon)
    x, y = planar.flat.T
    at = [geometry.corners[:, k].take(triangle) + shift for k in range(3)]
    second, third = u.astype(np.float64), v.astype(np.float64)
    weights = (1 - second - third, second, third)
    return (
        sum(weight * x.take(index) for weight, index in zip(weights, at, strict=True)),
        sum(weight * y.take(index) for weight, index in zip(weights, at, strict=True)),
    )


def _bilinear(
    corners: list[NDArray[np.float64]], x: NDArray[np.float64], y: NDArray[np.float64]
) -> NDArray[np.float32]:
    """(4, m) weights (1 - s)(1 - t), s (1 - t), s t, (1 - s) t of convex quads, counter-clockwise.

    t solves k2 t^2 + k1 t + k0 = 0. Inside a convex quad the Jacobian of the map from (s, t), 2 k2 t + k1, is
    the positive root of the discriminant, which selects t. There is a form without cancellation for either
    sign of k1, also for parallelograms (k2 = 0). s is the hit's position along the line that joins two
    opposite edges at t.
    """
    # The quadratic's coefficients, after Quilez.
    (x0, y0), (x1, y1), (x2, y2), (x3, y3) = (corner.T for corner in corners)
    ex, ey, fx, fy = x1 - x0, y1 - y0, x3 - x0, y3 - y0
    gx, gy, hx, hy = x2 - x3 - ex, y2 - y3 - ey, x - x0, y - y0
    k2 = gx * fy - gy * fx
    k1 = ex * fy - ey * fx + hx * gy - hy * gx
    k0 = hx * ey - hy * ex

    # The root that keeps orientation, as a ratio without cancellation.
    root = np.sqrt(np.maximum(k1 * k1 - 4 * k2 * k0, 0))
    is_rising = k1 >= 0
    over = np.where(is_rising, -2 * k0, root - k1)
    under = np.where(is_rising, k1 + root, 2 * k2)
    t = np.clip(_ratio(over, under), 0, 1)

    # s by projection onto the line at t.
    ax, ay = ex + gx * t, ey + gy * t
    s = np.clip(_ratio((hx - fx * t) * ax + (hy - fy * t) * ay, ax * ax + ay * ay), 0, 1)
    weights = np.empty((4, len(x)), F)
    for k, weight in enumerate(((1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t)):
        weights[k] = weight
    return weights


def _mean_value(
    flat: NDArray[np.float64],
    start: Ids,
    last: Ids,
    count: int,
    x: NDArray[np.float64],
    y: NDArray[np.float64],
) -> NDArray[np.float64]:
    """(count, m) mean value coordinates in polygons that are padded to `count` corners with their first."""
    # A batch of hits at a time.
    weights = np.empty((count, len(x)))
    number = np.arange(count, dtype=np.int32)[:, None]
    width = max(BLOCK // count, 1)
    for begin in range(0, len(x), width):
        part = slice(begin, begin + width)
        at = start[part] + np.where(number <= last[part], number, 0)
        weights[:, part] = _mean_value_of(flat[:, 0].take(at) - x[part], flat[:, 1].take(at) - y[part])

    # The weights of padding corners belong to the first corner.
    for k in range(1, count):
        weights[0] += np.where(last < k, weights[k], 0)
        weights[k] = np.where(last < k, 0, weights[k])
    return weights


def _mean_value_of(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, m) coordinates from the vectors (x, y) of each hit to its n corners, in radii of the polygon.

    w_i = (tan(a_{i-1} / 2) + tan(a_i / 2)) / r_i, where a_i is the angle that edge i subtends. Tangents are
    computed without cancellation; on an edge they are 1 / `TINY` instead of infinite. Consecutive corners at
    one position share the weight that one of them would have.
    """
    # |a| |b|, a.b and a x b of consecutive corners.
    following_x, following_y = np.roll(x, -1, axis=0), np.roll(y, -1, axis=0)
    r = np.sqrt(x * x + y * y)
    both = r * np.roll(r, -1, axis=0)
    inner = x * following_x + y * following_y
    outer = x * following_y - y * following_x

    # tan(a / 2) = sin a / (1 + cos a), or (1 - cos a) / sin a for angles above 90 degrees.
    is_wide = inner < 0
    least = TINY * (both - inner)
    outer = np.where(is_wide & (np.abs(outer) < least), least, outer)
    tangent = _ratio(np.where(is_wide, both - inner, outer), np.where(is_wide, outer, both + inner))

    # Normalize; the sum has a fixed order, which numpy's would take from the array's shape.
    weights = (np.roll(tangent, 1, axis=0) + tangent) / np.maximum(r, TINY)
    weights[r <= TINY] = TINY**-3  # on a corner: outweighs all others
    total = weights[0].copy()
    for row in weights[1:]:
        total += row
    return weights / total


def _ratio(over: NDArray[np.float64], under: NDArray[np.float64]) -> NDArray[np.float64]:
    """`over` / `under`, 0 where `under` is 0."""
    return np.divide(over, under, out=np.zeros_like(over), where=under != 0)
