"""Rays on the measured surface; those that leave a tile sideways enter it again on the other side."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors, column_major, dot, length, take_rows
from illumcli.gonioreflectometer.surface import Surface
from illumcli.rays.embree import Tracer
from illumcli.rays.offsets import effective_edge, offset_ray_origins
from illumcli.records import Record

LAPS = 1000
"""Times that a ray enters the block of tiles anew; at 1 degree above the plane few need a tenth."""
ENOUGH = 200_000
"""Triangles up to which the block of tiles grows, so that few rays leave it sideways."""
MARGINS = 0.05, 6.0
"""Least and greatest margin of the block around its tile [periods]."""
_INSIDE = 0.98  # of the margin: where rays go on from, so that no crack is at the block's border


class Hits(Record):
    """The first point of the surface on each of N rays."""

    is_hit: NDArray[np.bool_]  # (N,)
    position: NDArray[np.float64]  # (N, 3) within the tile; of a miss: anything
    normal: Vectors  # (N, 3) of the triangle, turned against the ray
    edge: NDArray[np.float32]  # (N,) `effective_edge` of the triangle

    def take(self, index: NDArray[np.intp]) -> Hits:
        """Some of them."""
        return Hits(*(take_rows(values, index) for values in vars(self).values()))


class Bench:
    """The surface in Embree's tree, scaled so that the longer side of its footprint is 1."""

    def __init__(self, surface: Surface) -> None:
        self.scale = float(surface.size.max())
        self.size = surface.size / self.scale
        self.is_tile = surface.is_tile
        vertices = surface.vertices.copy()
        vertices[:, :2] -= surface.low
        vertices /= self.scale
        self.bottom, self.top = float(vertices[:, 2].min()), float(vertices[:, 2].max())

        # A tile gets a margin of copies; all rays start within the tile.
        triangles, self._source = surface.triangles, np.arange(len(surface.triangles), dtype=np.int32)
        self._margin = 0.0
        if surface.is_tile:
            self._margin = float(np.clip((np.sqrt(ENOUGH / len(triangles)) - 1) / 2, *MARGINS))
            vertices, triangles, self._source = _with_margin(vertices, triangles, self.size, self._margin)
        self._vertices, self._triangles = vertices, triangles
        self._copies = np.empty(len(surface.triangles), np.int32)  # one in the block of each triangle
        self._copies[self._source] = np.arange(len(triangles), dtype=np.int32)
        corners = [take_rows(vertices, corner) for corner in triangles.T]
        edges = np.maximum.reduce([length(corners[i] - corners[i - 1]) for i in range(3)])
        areas = take_rows(surface.areas, self._source) * (2 / self.scale**2)
        self._edges = effective_edge(edges.astype(F), areas)
        self._normals = surface.normals
        self._tracer = Tracer(vertices.astype(F), triangles)

    def counting(self, stop: threading.Event | None = None) -> Bench:
        """The same bench with its own count of rays, for one thread.

        Once `stop` is set, rays raise `Interrupted`.
        """
        bench = object.__new__(Bench)
        vars(bench).update(vars(self))
        bench._tracer = self._tracer.counting(stop)
        return bench

    @property
    def rays(self) -> int:
        """Rays cast."""
        return self._tracer.rays

    def first_points(self, towards: Vectors, u: Vectors) -> Hits:
        """What an eye far away in the unit direction `towards` (N, 3) sees through points of the footprint.

        `u` has (N, 2) the points as shares of the footprint.
        """
        o = np.zeros_like(towards)
        o[:, 0], o[:, 1] = u[:, 0] * self.size[0], u[:, 1] * self.size[1]
        climb = (self.top + 1e-4) / towards[:, 2]
        o += towards * climb[:, None]
        return self.closest(o, -towards)

    def points_on(self, triangle: NDArray[np.int32], u: Vectors) -> Hits:
        """Points of triangles of the surface, (N, 2) `u` uniform gives points uniform by area."""
        fold = u.sum(axis=1) > 1
        b, c = np.where(fold, 1 - u[:, 0], u[:, 0]), np.where(fold, 1 - u[:, 1], u[:, 1])
        place = self._copies[triangle]
        position = self._at(place, b, c)
        return self._placed(place, position, take_rows(self._normals, triangle))

    def closest(self, origins: Vectors, directions: Vectors) -> Hits:
        """The first points on rays; origins may lie anywhere."""
        count = len(directions)
        triangle, position = np.full(count, -1, np.int32), np.zeros((count, 3), order="F")
        left = np.arange(count)
        o, d = self._wrapped(origins), directions
        for _ in range(LAPS):
            hits = self._tracer.closest(column_major(o, F), column_major(d, F), retry=False)
            found = np.flatnonzero(hits.triangle >= 0)
            at = left[found]
            triangle[at] = hits.triangle[found]
            position[at] = self._at(hits.triangle[found], hits.u[found], hits.v[found])
            left, o, d = self._sideways(left, o, d, hits.triangle < 0)
            if not len(left):
                break
        return self._placed(triangle, position, -directions)

    def occluded(self, hits: Hits, directions: Vectors) -> NDArray[np.bool_]:
        """(N,) True where the surface is in the way of a ray that leaves a point of it."""
        out = np.zeros(len(directions), np.bool_)
        left, d = np.arange(len(directions)), directions
        o: Vectors = offset_ray_origins(hits.position, hits.normal.astype(F), hits.edge).astype(np.float64)
        for _ in range(LAPS):
            blocked = self._tracer.occluded(column_major(o, F), column_major(d, F))
            out[left[blocked]] = True
            left, o, d = self._sideways(left, o, d, ~blocked)
            if not len(left):
                break
        return out

    def leaving(self, hits: Hits, directions: Vectors) -> Hits:
        """The first points on rays that leave points of the surface."""
        starts = offset_ray_origins(hits.position, hits.normal.astype(F), hits.edge)
        return self.closest(starts.astype(np.float64), directions)

    def _at(self, triangle: NDArray[np.int32], u: NDArray[np.floating], v: NDArray[np.floating]) -> Vectors:
        a, b, c = (take_rows(self._vertices, corner) for corner in take_rows(self._triangles, triangle).T)
        u, v = u.astype(np.float64), v.astype(np.float64)
        return a * (1 - u - v)[:, None] + b * u[:, None] + c * v[:, None]

    def _placed(self, triangle: NDArray[np.int32], position: Vectors, towards: Vectors) -> Hits:
        """The hits, brought back into the tile, with normals on the side of `towards`."""
        is_hit = triangle >= 0
        known = np.where(is_hit, triangle, 0)
        normal = take_rows(self._normals, take_rows(self._source, known))
        normal = normal * np.where(dot(normal, towards) < 0, -1.0, 1.0)[:, None]
        return Hits(
            is_hit, self._wrapped(position).astype(np.float64, copy=False), normal, self._edges[known]
        )

    def _wrapped(self, points: Vectors) -> Vectors:
        """The points moved by whole periods into the tile."""
        if not self.is_tile:
            return points
        moved = points.copy(order="F")
        for axis, size in enumerate(self.size):
            moved[:, axis] -= np.floor(moved[:, axis] / size) * size
        return moved

    def _sideways(
        self, left: NDArray[np.intp], o: Vectors, d: Vectors, is_open: NDArray[np.bool_]
    ) -> tuple[NDArray[np.intp], Vectors, Vectors]:
        """Those rays that leave the block sideways below the top, where they enter it again."""
        if not self.is_tile:
            return left[:0], o[:0], d[:0]
        keep = np.flatnonzero(is_open)
        o, d = o[keep], d[keep]
        border = self._margin * self.size * _INSIDE
        borders = [np.where(d[:, i] > 0, self.size[i] + border[i], -border[i]) for i in (0, 1)]
        along = np.fmin(*(_distance(borders[i] - o[:, i], d[:, i]) for i in (0, 1)))
        up = _distance(np.where(d[:, 2] > 0, self.top, self.bottom) - o[:, 2], d[:, 2])
        goes_on = along < up
        left, o, d = left[keep[goes_on]], o[goes_on], d[goes_on]
        return left, self._wrapped(o + d * along[goes_on][:, None]), d


def _distance(way: Floats, speed: Floats) -> Floats:
    """(N,) way / speed, infinite where nothing moves."""
    return np.divide(way, speed, out=np.full_like(way, np.inf), where=speed != 0)


def _with_margin(
    vertices: Vectors, triangles: NDArray[np.int32], size: Floats, margin: float
) -> tuple[Vectors, NDArray[np.int32], NDArray[np.int32]]:
    """A tile with copies of its triangles as far as the margin [periods], and the triangle of each copy."""
    reach = int(np.ceil(margin))
    corners = [take_rows(vertices, corner)[:, :2] for corner in triangles.T]
    least, most = np.minimum.reduce(corners), np.maximum.reduce(corners)
    points, parts, sources = [vertices], [triangles], [np.arange(len(triangles), dtype=np.int32)]
    count = len(vertices)
    for step in np.ndindex(2 * reach + 1, 2 * reach + 1):
        shift = (np.array(step) - reach) * size
        near = (least + shift <= (1 + margin) * size) & (most + shift >= -margin * size)
        chosen = np.flatnonzero(near.all(axis=1)).astype(np.int32)
        if not shift.any() or not len(chosen):
            continue
        used, renumbered = np.unique(triangles[chosen], return_inverse=True)
        points.append(vertices[used] + [*shift, 0.0])
        parts.append((renumbered.reshape(-1, 3) + count).astype(np.int32))
        sources.append(chosen)
        count += len(used)
    return np.concatenate(points), np.concatenate(parts), np.concatenate(sources)
