"""Which points have nothing above their tangent plane: they are open, and no ray need tell.

The vertices of all occluders stand in a tree of clusters, eight to one. A cluster is bounded by a round slab
that lies along its surface, whose height falls with the square of its width; points that lie together are
asked about together. So on a convex surface of any fineness a group looks at some hundreds of clusters.
"""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Ids, Vectors, column_major, dot, take_rows
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.geometry.spatial_order import compact
from illumcli.rays.interaction import facets, facing
from illumcli.rays.offsets import SHARE
from illumcli.records import Record

FAN = 8
GROUP = 64  # points asked about together
GROUPS_AT_ONCE = 64
TRY_FIRST = 16
"""One group in so many is asked first; where none of its points is clear, its neighbours cast rays."""
MOST_CLUSTERS = 1 << 13
"""Groups that look at more clusters than this cast rays instead."""
FEWEST = 64
"""Where the cheap tests leave fewer than one point in so many, the tree is not asked: to build it takes as
long as a few rays from every vertex."""
PROBES = 64
TRIED = 64
"""Rows of triangles, of either side, by which a world is judged."""
CLEARLY = 1e-5


class Slabs(Record):
    """A level of the tree: K round slabs."""

    centre: NDArray[np.float64]  # (K, 3)
    axis: NDArray[np.float64]  # (K, 3) unit
    low: NDArray[np.float64]  # (K,) along the axis
    high: NDArray[np.float64]  # (K,)
    width: NDArray[np.float64]  # (K,) radius across the axis


class Groups(Record):
    """Planes that are nearly the same: those of group g hold every plane of its points.

    For a point o with normal n, and any x: n.(x - o) <= axis.(x - centre) + spread |x - centre| + room.
    """

    centre: NDArray[np.float64]  # (G, 3)
    axis: NDArray[np.float64]  # (G, 3)
    spread: NDArray[np.float64]  # (G,)
    room: NDArray[np.float64]  # (G,)


class ClusterTree:
    """The vertices of occluders, asked what is above a plane; safe to ask from threads.

    The tree is built when a point is asked about that the vertices farthest out do not settle.
    """

    def __init__(self, vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> None:
        used = np.zeros(len(vertices), bool)
        used[triangles.ravel()] = True
        self._points = np.asarray(vertices[used], np.float64, order="C")
        self._probes = extremes(self._points)
        self._levels: list[Slabs] | None = None
        self._building = threading.Lock()

    def _tree(self) -> list[Slabs]:
        """Levels of clusters, from the finest; the points are put in their order."""
        with self._building:
            if self._levels is None:
                self._points = self._points[compact(self._points)]
                levels, size = [], FAN
                while len(self._points) > size:
                    levels.append(slabs(self._points, size))
                    size *= FAN
                self._levels = levels
        return self._levels

    def clears(self, origins: Vectors, n: Vectors) -> NDArray[np.bool_]:
        """(M,) True where no occluder reaches above the plane through an origin with normal `n`.

        Origins are those of rays, off the surface by more than the rounding of this test; points in a row
        should lie close together. False may also mean that it was too much work to tell: that a group of
        points would look at more than `MOST_CLUSTERS`.
        """
        if not len(self._points):
            return np.ones(len(origins), bool)
        group = np.arange(len(origins)) // GROUP
        tried = group % TRY_FIRST == 0
        out = np.zeros(len(origins), bool)
        self._clear(out, np.flatnonzero(tried), origins, n)
        cleared = np.bincount(group // TRY_FIRST, out) > 0
        self._clear(out, np.flatnonzero(~tried & cleared[group // TRY_FIRST]), origins, n)
        return out

    def _clear(self, out: NDArray[np.bool_], lanes: NDArray[np.int64], origins: Vectors, n: Vectors) -> None:
        """Answer for some lanes."""
        for first in range(0, len(lanes), GROUP * GROUPS_AT_ONCE):
            lane = lanes[first : first + GROUP * GROUPS_AT_ONCE]
            o, up = np.asarray(origins[lane], np.float64), np.asarray(n[lane], np.float64)
            out[lane] = self._cleared(o, up)

    def _cleared(self, o: NDArray[np.float64], n: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(M,) True where no occluder is above the plane, as far as probes, the points near by and then
        clusters tell."""
        out = self._probed(o, n)
        left = np.flatnonzero(out)
        if len(left) * FEWEST < len(o):
            return np.zeros(len(o), bool)
        if left.size:
            out[left] = self._below(o[left], n[left])
        return out

    def clear_planes(self, o: NDArray[np.float64], n: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(M,) as `clears`, for M a multiple of 64: what is told of every 64 in a row depends on these alone.

        Planes through points of occluders, lifted a little.
        """
        out = self._worth(o, n)
        some = np.repeat(out.reshape(-1, GROUP).any(axis=1), GROUP)
        if some.any():
            out[some] &= self._below(o[some], n[some])
        return out

    def may_clear(self, o: NDArray[np.float64], n: NDArray[np.float64]) -> bool:
        """Do the cheap tests leave enough of these planes for `clear_planes` to be worth it?"""
        return bool(self._worth(o, n).sum() * FEWEST >= len(o))

    def _worth(self, o: NDArray[np.float64], n: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(M,) the planes that the tree is asked about."""
        out = self._probed(o, n)
        groups = out.reshape(-1, GROUP)
        groups[groups.sum(axis=1) * 2 < GROUP] = False  # the tree tells little of what is mostly under others
        return out

    def _probed(self, o: NDArray[np.float64], n: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(M,) False where the vertices farthest out or the points near by are clearly above the plane."""
        height = np.einsum("ij,ij->i", o, n)
        out = (n.astype(F) @ self._probes.T).max(axis=1) <= height + CLEARLY
        for first in range(0, len(o), GROUP) if out.any() else ():
            own = slice(first, first + GROUP)
            if out[own].any():
                out[own] &= clear_of_each_other(o[own], n[own])
        return out

    def _below(self, o: NDArray[np.float64], n: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(M,) True where all points are below, for points that no probe is above."""
        planes = groups(o, n)
        group, cluster, told = self._near(planes)
        out = np.zeros(len(o), bool)
        bounds = np.searchsorted(group, np.arange(len(planes.centre) + 1))
        for g in np.flatnonzero(told):
            lane = slice(g * GROUP, (g + 1) * GROUP)
            first = cluster[bounds[g] : bounds[g + 1]] * FAN
            rows = (first[:, None] + np.arange(FAN)).ravel()
            near = self._points[rows[rows < len(self._points)]]
            height = np.einsum("ij,ij->i", o[lane], n[lane])
            out[lane] = (n[lane] @ near.T).max(axis=1, initial=-np.inf) <= height
        return out

    def _near(self, planes: Groups) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Pairs (group, cluster of `FAN` points), by group, that may have a point above a plane, and for each
        group whether they are all there: groups with more than `MOST_CLUSTERS` are left out."""
        count = len(planes.centre)
        told = np.ones(count, bool)
        group, cluster = np.arange(count), np.zeros(count, np.int64)  # the root, which holds all
        for level in reversed(self._tree()):
            few = np.bincount(group, minlength=count) <= MOST_CLUSTERS // FAN
            told &= few
            group, cluster = group[few[group]], cluster[few[group]]
            group = np.repeat(group, FAN)
            cluster = (cluster[:, None] * FAN + np.arange(FAN)).ravel()
            inside = cluster < len(level.centre)
            group, cluster = group[inside], cluster[inside]
            axis = planes.axis[group]
            away = level.centre[cluster] - planes.centre[group]
            upright = np.einsum("ij,ij->i", axis, level.axis[cluster])
            low, high, width = level.low[cluster], level.high[cluster], level.width[cluster]
            reach = np.einsum("ij,ij->i", axis, away) + np.maximum(upright * high, upright * low)
            reach += np.sqrt(np.maximum(1 - upright * upright, 0)) * width
            far = np.sqrt(np.einsum("ij,ij->i", away, away)) + width + np.maximum(high, -low)
            kept = reach + planes.spread[group] * far + planes.room[group] > 0
            group, cluster = group[kept], cluster[kept]
        return group, cluster, told


class OpenTriangles:
    """Which triangles have nothing above their plane, on either side; safe to ask from threads.

    All samples of a triangle look up from one plane, so each is settled once, with 63 others in a row: an
    answer depends on these alone, whoever asks first. Where next to none of some rows spread over the world
    is open, as on a scanned mesh, no other is looked at.
    """

    def __init__(self, world: SceneGeometry) -> None:
        self._world = world
        self._horizon = ClusterTree(world.vertices, world.triangles)
        self._blocks = -(-len(world.triangles) // GROUP)  # of either side
        self._asked = np.zeros(2 * self._blocks, bool)
        self._clear = np.zeros(2 * self._blocks * GROUP, bool)
        tried = np.arange(0, 2 * self._blocks, max(1, self._blocks // TRIED))
        self._any = len(tried) > 0 and self._horizon.may_clear(*self._planes(tried))

    def open(self, triangle: Ids, behind: NDArray[np.bool_], worth: int) -> NDArray[np.bool_]:
        """(M,) True where nothing is above the triangle that a sample lies on, on the side that is seen.

        Rows of triangles that fewer than `worth` of the samples lie on are not looked at.
        """
        if not self._any:
            return np.zeros(len(triangle), bool)
        number = triangle + behind * np.int64(self._blocks * GROUP)
        block = number // GROUP
        seen = np.bincount(block, minlength=2 * self._blocks) >= worth
        new = np.flatnonzero(seen & ~self._asked)
        for first in range(0, len(new), GROUPS_AT_ONCE):
            self._settle(new[first : first + GROUPS_AT_ONCE])
        return self._clear.take(number) & seen.take(block)

    def _settle(self, blocks: NDArray[np.int64]) -> None:
        self._clear[_numbers(blocks)] = self._horizon.clear_planes(*self._planes(blocks))
        self._asked[blocks] = True

    def _planes(self, blocks: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Origins and unit normals of the planes of these rows, (64 K, 3) each, lifted as rays are."""
        side, triangle = np.divmod(_numbers(blocks), self._blocks * GROUP)
        triangle = np.minimum(triangle, len(self._world.triangles) - 1).astype(np.int32)
        return facet_planes(self._world, triangle, side > 0)


def facet_planes(
    world: SceneGeometry, triangle: Ids, behind: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Origins and unit normals of the planes of N triangles, (N, 3) each, on the side that is seen, lifted as
    rays are."""
    zero = np.zeros(len(triangle), F)
    facet = facets(world, triangle, zero, zero, np.zeros((len(triangle), 3), F))
    n = facing(facet.ng, behind).astype(np.float64)
    v0 = facet.position
    others = (take_rows(world.vertices, world.triangles[:, k].take(triangle)) for k in (1, 2))
    lowest = np.minimum.reduce([np.zeros(len(n)), *(dot(n, other - v0) for other in others)])
    # no ray starts lower: |ng|.|p| of `offset_ray_origins` is at least the distance of the plane from the
    # centre
    step = lowest + SHARE * (np.abs(dot(n, v0)) + facet.edge)
    o = v0 + step[:, None] * n
    return np.ascontiguousarray(o), np.ascontiguousarray(n)


def _numbers(blocks: NDArray[np.int64]) -> NDArray[np.int64]:
    """(64 K,) what the rows of these numbers hold."""
    return (blocks[:, None] * GROUP + np.arange(GROUP)).ravel()


def clear_of_each_other(o: NDArray[np.float64], n: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(M,) False where one of the points is clearly above the plane of another.

    The points lie on occluders, off them by a hundredth of what counts as clearly: in a hollow this tells at
    once.
    """
    near, up = (o - o[0]).astype(F), n.astype(F)
    return (up @ near.T).max(axis=1) <= np.einsum("ij,ij->i", up, near) + CLEARLY


def groups(o: NDArray[np.float64], n: NDArray[np.float64]) -> Groups:
    """Every `GROUP` planes in a row, through `o` with unit normals `n`, as one."""
    count = -(-len(o) // GROUP)
    more = count * GROUP - len(o)
    o = np.concatenate([o, np.repeat(o[-1:], more, axis=0)]).reshape(count, GROUP, 3)
    n = np.concatenate([n, np.repeat(n[-1:], more, axis=0)]).reshape(count, GROUP, 3)
    centre, axis = o.mean(axis=1), n.mean(axis=1)
    size = np.linalg.norm(axis, axis=1, keepdims=True)
    axis = np.where(size > 0.1, axis / np.maximum(size, 0.1), n[:, 0])
    spread = np.linalg.norm(n - axis[:, None], axis=2).max(axis=1)
    room = -np.einsum("gpi,gpi->gp", n, o - centre[:, None]).min(axis=1)
    return Groups(centre, axis / np.linalg.norm(axis, axis=1, keepdims=True), spread, room)


def slabs(points: NDArray[np.float64], size: int) -> Slabs:
    """A slab around each `size` points in a row, along the plane that fits them best."""
    count = -(-len(points) // size)
    padded = np.concatenate([points, np.repeat(points[-1:], count * size - len(points), axis=0)])
    group = padded.reshape(count, size, 3)
    centre = group.mean(axis=1)
    centred = group - centre[:, None]
    _, vectors = np.linalg.eigh(np.matmul(centred.transpose(0, 2, 1), centred))
    axis = np.ascontiguousarray(vectors[:, :, 0])
    along = np.matmul(centred, axis[:, :, None])[:, :, 0]
    across = np.matmul(np.square(centred), np.ones(3)) - np.square(along)  # squared, and no less than along's
    width = np.sqrt(across.max(axis=1).clip(0))
    # a rounding wider than they are: bounds must hold
    room = 1e-12
    return Slabs(centre, axis, along.min(axis=1) - room, along.max(axis=1) + room, width + room)


def extremes(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(K, 3) the points farthest out along directions spread over the sphere; most others lie behind them."""
    k = np.arange(PROBES)
    z = 1 - (2 * k + 1) / PROBES
    angle = np.pi * (3 - 5**0.5) * k
    r = np.sqrt(1 - z * z)
    spread = np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)
    if not len(points):
        return points
    near, spread = column_major(points, F), spread.astype(F)
    return points[np.unique([int(np.argmax(near @ d)) for d in spread])].astype(F)
