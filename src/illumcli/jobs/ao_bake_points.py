"""Where a bake asks for obscurance: every vertex of a scene, or points spread over its area."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Ids, Vectors, columns, cross, dot, length, rows, unit
from illumcli.geometry.assemble import World
from illumcli.rays.offsets import lifted
from illumcli.rays.sampling import PLASTIC, hashed, stream, unit_interval
from illumcli.records import Record

SEAM = np.cos(np.radians(60.0))
"""Copies of a vertex whose normals stand within 60 degrees share one normal."""
MOST_COPIES = 31
"""Copies are compared with as many that follow them."""


class Points(Record):
    """M points that cast rays."""

    origins: Vectors  # (M, 3) float32 off the surface, in radii
    n: Vectors  # (M, 3) float32 unit
    number: NDArray[np.uint32]  # (M,) what their random numbers are keyed by
    thing: Ids  # (M,) object

    def take(self, lanes: NDArray[np.int64]) -> Points:
        """Some of them, in this order."""
        return Points(rows(self.origins, lanes), rows(self.n, lanes), self.number[lanes], self.thing[lanes])


class Vertices(Record):
    """The vertices of a world that cast rays, and which of them each vertex takes its value from."""

    points: Points
    source: NDArray[np.int64]  # (V,) row of `points`, -1 where a vertex has none
    unreferenced: int  # vertices that no polygon names
    without_normal: int  # vertices of triangles without area
    copies: int  # vertices that take the value of another at the same place


def vertex_points(world: World) -> Vertices:
    """Every vertex that has a normal; copies at one place that agree in their normal cast rays once.

    The normal is the mean of the triangles at the vertex by angle. Where a mesh holds several vertices at one
    place (seams of uv, loose triangles) those within 60 degrees share their triangles, so that a seam does
    not show and an edge that is sharp stays sharp.
    """
    sums, longest, used = _around(world)
    thing = _thing_of_vertex(world)
    n, longest, source = _shared_over_copies(world, sums, longest, thing)
    has = dot(n, n) > 0.25
    own = np.flatnonzero(has & (source == np.arange(len(source))))
    place = np.full(len(source), -1, np.int64)
    place[own] = np.arange(len(own))
    row = np.where(has, place[source], -1)
    position = columns(rows(world.vertices, own), np.float64)
    normal = columns(rows(n, own), F)
    origins = lifted(position, normal, longest[own].astype(F))
    points = Points(origins, normal, own.astype(np.uint32), thing[own])
    copies = int(np.count_nonzero(has)) - len(own)
    return Vertices(points, row, int((~used).sum()), int((used & ~has).sum()), copies)


def _around(world: World) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Per vertex: sum of the normals of its triangles by angle, their longest edge, is it used at all."""
    count = len(world.vertices)
    corner = [columns(rows(world.vertices, world.triangles[:, k]), np.float64) for k in range(3)]
    edges = [corner[(k + 1) % 3] - corner[k] for k in range(3)]
    area = cross(edges[0], edges[1])
    normal = unit(area)
    edge = np.maximum(np.maximum(length(edges[0]), length(edges[1])), length(edges[2]))
    sums = np.zeros((count, 3), order="F")
    longest = np.zeros(count)
    used = np.zeros(count, bool)
    for k in range(3):
        index = world.triangles[:, k]
        angle = np.arctan2(length(area), -dot(edges[k], edges[k - 1]))
        for axis in range(3):
            sums[:, axis] += np.bincount(index, angle * normal[:, axis], count)
        np.maximum.at(longest, index, edge)
        used[index] = True
    return sums, longest, used


def _thing_of_vertex(world: World) -> Ids:
    first = [placed.first_vertex for placed in world.placed]
    count = np.diff([*first, len(world.vertices)])
    return np.repeat(np.arange(len(first), dtype=np.int32), count)


def _shared_over_copies(
    world: World, sums: NDArray[np.float64], longest: NDArray[np.float64], thing: Ids
) -> tuple[Vectors, NDArray[np.float64], NDArray[np.int64]]:
    """Unit normal, longest edge and the first of equal copies, per vertex."""
    order, same = _by_place(world.vertices, thing)
    own, total, edge = unit(sums), sums.copy(order="F"), longest.copy()
    shifts = list(_runs(same))
    for s, lanes in shifts:
        a, b = order[lanes], order[lanes + s]
        joint = np.flatnonzero(dot(rows(own, a), rows(own, b)) > SEAM)
        a, b = a[joint], b[joint]
        total[a] += sums[b]
        total[b] += sums[a]
        edge[a], edge[b] = np.maximum(edge[a], longest[b]), np.maximum(edge[b], longest[a])
    n = unit(total)
    source = np.arange(len(n))
    for s, lanes in shifts:
        a, b = order[lanes], order[lanes + s]
        equal = np.flatnonzero(length(rows(n, a) - rows(n, b)) < 1e-6)
        np.minimum.at(source, b[equal], source[a[equal]])
    return n, edge, source


def _by_place(vertices: Vectors, thing: Ids) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Vertices in an order in which those of one object at one place follow each other, by number, and
    (V - 1,) whether each is at the place of the one before."""
    bits = (np.ascontiguousarray(vertices) + F(0)).view(np.uint32).astype(np.uint64)  # -0 is 0
    key = thing.astype(np.uint64)
    for axis in range(3):
        key = (key ^ bits[:, axis]) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    order = np.argsort(key, kind="stable")
    a, b = order[:-1], order[1:]
    same = (key[a] == key[b]) & (thing[a] == thing[b]) & (vertices[a] == vertices[b]).all(axis=1)
    return order, same


def _runs(same: NDArray[np.bool_]) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """Shifts from 1 on, and the lanes whose follower by so many is at the same place, while there are any."""
    run = np.concatenate([[0], np.cumsum(same)])
    for shift in range(1, min(MOST_COPIES, len(same)) + 1):
        lanes = np.flatnonzero(run[shift:] - run[:-shift] == shift)
        if not lanes.size:  # no run is that long, and none is longer
            return
        yield shift, lanes


class AreaPoints(Record):
    """Points spread evenly over triangles, for values that are fitted to them."""

    points: Points
    triangle: Ids  # (M,)
    u: NDArray[np.float64]  # (M,) weight of corner 1
    v: NDArray[np.float64]  # (M,) weight of corner 2
    area: NDArray[np.float64]  # (M,) of the surface each stands for, in radii^2


def area_points(world: World, count: int, seed: int) -> AreaPoints:
    """About `count` points on triangles that have an area: one each, and more by area.

    On each triangle they follow the R2 sequence (Roberts 2018), shifted by a hash of its number.
    """
    corner = [columns(rows(world.vertices, world.triangles[:, k]), np.float64) for k in range(3)]
    area_vector = cross(corner[1] - corner[0], corner[2] - corner[0])
    area = length(area_vector) / 2
    total = area.sum()
    share = np.ceil(area * (count / total)) if total > 0 else np.zeros(len(area))
    size = share.astype(np.int64)
    triangle = np.repeat(np.arange(len(size), dtype=np.int32), size)
    within = np.arange(len(triangle)) - np.repeat(np.cumsum(size) - size, size)
    key = stream(seed, "area")
    shift = [unit_interval(hashed(key + k, np.arange(len(size), dtype=np.uint32)))[triangle] for k in (0, 1)]
    a, b = (within / PLASTIC + shift[0]) % 1, (within / PLASTIC**2 + shift[1]) % 1
    over = a + b > 1  # the other half of the square folds onto the triangle
    a, b = np.where(over, 1 - a, a), np.where(over, 1 - b, b)
    at = [rows(each, triangle) for each in corner]
    position = at[0] + a[:, None] * (at[1] - at[0]) + b[:, None] * (at[2] - at[0])
    n = columns(rows(unit(area_vector), triangle), F)
    edge = np.maximum(length(at[1] - at[0]), np.maximum(length(at[2] - at[0]), length(at[2] - at[1])))
    points = Points(
        lifted(position, n, edge.astype(F)),
        n,
        np.arange(len(triangle), dtype=np.uint32),
        world.objects[triangle],
    )
    return AreaPoints(points, triangle, a, b, (area / np.maximum(size, 1))[triangle])
