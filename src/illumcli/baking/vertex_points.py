"""Points at vertices: one for each vertex and shading normal.

The value at a vertex is the limit that images tend to there. Its rays are divided among the triangles around
it by angle; each starts just inside its triangle, offset from it, and is mirrored at that triangle's plane. A
vertex with several shading normals (a hard edge, a seam) has a point for each.

What a ray meets next to the vertex depends on the angle at which it starts. So the angles, like directions,
are spread evenly, and there are more of them the more rays there are: the error keeps falling. Where the
triangles are nearly in one plane, angles matter little, and the rays of a packet share a start.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, column_major, cross, dot, length, take_rows, unit
from illumcli.baking.points import Points, Side, Surfaces
from illumcli.baking.wedges import CornerWedges, Triangles, corner_wedges, polygon_corners, triangles_of
from illumcli.baking.work import in_blocks
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.rays.offsets import offset_ray_origins
from illumcli.records import Record
from illumcli.visibility.hemisphere import Hemispheres, packet_of_ray

RAYS_PER_ORIGIN = 4
"""Rays that start at one place, where the triangles around a vertex are not nearly in one plane."""
ORIGIN_STEP = 3**0.5
"""From the angle of one start to the next, in turns: with the golden angle of the spiral, the rays fill
directions and starts evenly."""
FLAT_COSINE, FLAT_ANGLE = 0.95, 0.95 * 2 * np.pi
"""Where no triangle around a point is at more than 18 degrees to the normal, and they close the fan, they are
nearly in one plane. With one start per packet of rays, errors there are the same."""
INSET = 2.0**-8
"""How far inside its triangle a ray of a vertex starts, as a share of the shorter edge there."""
SAME_NORMAL = 1e-4
"""Normals at one place that differ by less [rad] count as one: files write them with few digits."""
MAX_COPIES = 31
"""Normals at one place are compared with at most so many that follow them."""


class Wedges(Record):
    """K wedges, grouped by the point at their corner."""

    first: NDArray[np.int64]  # (M + 1,) first wedge of each point, and the end
    triangle: Ids  # (K,)
    vertex: NDArray[np.int32]  # (K, 3) of the corner, of the next one and of the previous one
    angle: NDArray[np.float32]  # (K,) at the corner [rad]


class VertexPoints(Points):
    """Points at vertices, one for each normal."""

    wedges: Wedges
    triangles: Triangles

    def hemispheres(
        self, index: NDArray[np.int64], offset: Floats, samples: int, sampler: str, side: Side = 1
    ) -> Hemispheres:
        if self.is_flat[index].all():
            origin_of_ray = packet_of_ray(sampler, samples)
        else:
            origin_of_ray = np.arange(samples, dtype=np.int32) % -(-samples // RAYS_PER_ORIGIN)
        origins = int(origin_of_ray.max()) + 1

        # the wedges of these points, and where each begins and ends among those of its point
        first, end = self.wedges.first[index], self.wedges.first[index + 1]
        count = end - first
        ends = np.cumsum(count)
        wedge = np.repeat(first - ends + count, count) + np.arange(ends[-1])
        angle = self.wedges.angle[wedge].astype(np.float64)
        upto = np.cumsum(angle)
        before = np.repeat((upto - angle)[ends - count], count)
        begins, total = upto - angle - before, (upto - before)[ends - 1]

        # the wedge of each origin, and the origin's angle inside it
        place = (np.arange(origins) * ORIGIN_STEP + offset[:, None]) % 1
        point = np.arange(len(index))
        upto = (upto - before) / np.repeat(total, count) + np.repeat(point, count)
        holder = np.searchsorted(upto, (place + point[:, None]).ravel(), side="right")
        holder = np.clip(holder, np.repeat(ends - count, origins), np.repeat(ends - 1, origins))
        turn = (place * total[:, None]).ravel() - begins[holder]
        turn = turn.clip(0, angle[holder]).astype(F)

        # where it starts; of the wedges, only those that are needed if these are few
        if len(holder) < len(wedge):
            wedge, holder = wedge[holder], np.arange(len(holder))
        base, ahead, aside, ng = self._insets(wedge, side)
        starts = take_rows(base, holder)
        starts += np.cos(turn)[:, None] * take_rows(ahead, holder)
        starts += np.sin(turn)[:, None] * take_rows(aside, holder)
        n = F(side) * take_rows(self.n, index)
        return Hemispheres(n, starts, take_rows(ng, holder), origin_of_ray=origin_of_ray)

    def _insets(self, wedge: NDArray[np.int64], side: Side) -> tuple[Vectors, Vectors, Vectors, Vectors]:
        """Of some wedges, (K, 3) float32 each: the corner, offset from its triangle; the step inwards along
        the next edge, and the one at right angles to it; the triangle's normal on that side."""
        vertex, triangle = take_rows(self.wedges.vertex, wedge), self.wedges.triangle.take(wedge)
        corner, following, last = (
            column_major(take_rows(self.geometry.vertices, vertex[:, k]), np.float64) for k in range(3)
        )
        of = self.triangles
        ng, edge, height = (take_rows(values, triangle) for values in (of.ng, of.edge, of.height))
        ahead, back = following - corner, last - corner
        reach = np.minimum(INSET * np.sqrt(np.minimum(dot(ahead, ahead), dot(back, back))), height / 4)
        normal = ng.astype(np.float64)
        along = unit(ahead - dot(ahead, normal)[:, None] * normal) * reach[:, None]
        return (
            offset_ray_origins(corner, F(side) * ng, edge),
            column_major(along, F),
            column_major(cross(normal, along), F),
            F(side) * ng,
        )

    def open_points(self, open_triangles: NDArray[np.bool_]) -> NDArray[np.bool_]:
        if not len(self.key):
            return np.zeros(0, bool)
        return np.logical_and.reduceat(open_triangles[self.wedges.triangle], self.wedges.first[:-1])


class Sides(Record):
    """K smooth sides of vertices: the corners of one vertex that have equal normals."""

    vertex: NDArray[np.int32]  # (K,)
    point: NDArray[np.int64]  # (K,) that gives the side its value
    angle: NDArray[np.float64]  # (K,) sum over its corners [rad]


class Vertices(Record):
    """The points of a bake, and which vertices and corners take their values from them."""

    points: VertexPoints
    point_of_corner: NDArray[np.int64]  # (C,) point of each polygon corner, -1 where it has none
    sides: Sides
    count: int  # vertices
    unreferenced: int  # vertices that no polygon uses
    without_normal: int  # vertices whose polygons all have area 0
    copies: int  # sides that share the point of another side at the same place


def vertex_points(surfaces: Surfaces, threads: int = 1) -> Vertices:
    """A point for every vertex and shading normal.

    Vertices of one object at one place with equal normals share a point: a seam of uv does not show, and a
    hard edge stays hard.
    """
    geometry, normals = surfaces.geometry, surfaces.normals
    polygons, triangles = polygon_corners(geometry), triangles_of(geometry, threads)
    vertex = polygons.vertex
    wedges = corner_wedges(geometry, polygons, triangles, threads)

    # corners that can cast rays: those with a normal and a wedge
    n = (
        take_rows(normals.values, np.maximum(normals.index, 0))
        if len(normals.values)
        else np.zeros((0, 3), F)
    )
    corner_angle = np.bincount(wedges.corner, wedges.angle, len(vertex)).astype(np.float64)
    can_cast = (normals.index >= 0) & (dot(n, n) > 0.25) & (corner_angle > 0)
    casting = np.flatnonzero(can_cast)

    # their sides, and the point of each side
    objects = _object_of_vertex(geometry)
    side, first_corner = _sides(vertex[casting], take_rows(n, casting))
    first_corner = casting[first_corner]
    point_of_side, first_side = _points_of_sides(
        geometry, objects, vertex[first_corner], take_rows(n, first_corner)
    )
    point_of_corner = np.full(len(vertex), -1, np.int64)
    point_of_corner[casting] = point_of_side[side]

    # the points themselves
    corner = first_corner[first_side]
    at = vertex[corner]
    normal = column_major(take_rows(n, corner), F)
    grouped = _grouped(wedges, point_of_corner, len(first_side))
    points = VertexPoints(
        geometry,
        normal,
        column_major(take_rows(geometry.vertices, at), F),
        _random_keys(at, len(geometry.vertices)),
        objects[at],
        _is_flat(grouped, normal, triangles.ng, threads),
        grouped,
        triangles,
    )

    # what becomes of the vertices
    used, has_point = np.zeros(len(geometry.vertices), bool), np.zeros(len(geometry.vertices), bool)
    used[vertex], has_point[vertex[casting]] = True, True
    angles = np.bincount(side, corner_angle[casting], len(first_corner)).astype(np.float64)
    return Vertices(
        points,
        point_of_corner,
        Sides(vertex[first_corner], point_of_side, angles),
        count=len(geometry.vertices),
        unreferenced=int((~used).sum()),
        without_normal=int((used & ~has_point).sum()),
        copies=len(first_corner) - len(first_side),
    )


def _grouped(wedges: CornerWedges, point_of_corner: NDArray[np.int64], count: int) -> Wedges:
    """The wedges of corners that have a point, point by point; `count` is that of the points."""
    point = point_of_corner.take(wedges.corner)
    first = np.zeros(count + 1, np.int64)
    np.cumsum(np.bincount(point + 1, minlength=count + 1)[1:], out=first[1:])

    # Sorting numbers that hold point and wedge is faster than a stable order of the points.
    bits = np.int64(len(point)).item().bit_length()
    order = np.sort((point << bits) | np.arange(len(point)))[len(point) - first[-1] :]
    order &= (1 << bits) - 1
    return Wedges(
        first,
        wedges.triangle.take(order),
        take_rows(wedges.vertex, order),
        wedges.angle.astype(F).take(order),
    )


def _is_flat(wedges: Wedges, n: Vectors, ng: Vectors, threads: int) -> NDArray[np.bool_]:
    """(M,) True for points whose wedges are nearly in one plane, all around."""
    out = np.zeros(len(n), bool)

    def compute(points: slice) -> None:
        first = wedges.first[points.start : points.stop + 1]
        own, begins = slice(first[0], first[-1]), first[:-1] - first[0]
        normal = take_rows(n[points], np.repeat(np.arange(len(begins)), np.diff(first)))
        cosine = dot(normal, take_rows(ng, wedges.triangle[own]))
        least = np.minimum.reduceat(cosine, begins)
        total = np.add.reduceat(wedges.angle[own], begins)
        out[points] = (least >= FLAT_COSINE) & (total >= FLAT_ANGLE)

    in_blocks(compute, len(n), threads)
    return out


def _sides(vertex: NDArray[np.int32], n: Vectors) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(C,) the side of each corner, those of one vertex and equal normals, and the first corner of each side,
    in ascending order."""
    # most vertices have one normal: that of their first corner
    corners = np.arange(len(vertex))
    first = np.zeros(vertex.max(initial=-1) + 1, np.int64)
    first[vertex[::-1]] = corners[::-1]
    lowest = first[vertex]

    # among the others, equal normals are found by sorting
    others = np.flatnonzero(np.logical_or.reduce((n != take_rows(n, lowest)).T))
    if others.size:
        order, same = _equal_rows(np.ascontiguousarray(take_rows(n, others)), vertex[others])
        begins = np.append(True, ~same)
        lowest[others[order]] = others[order][begins][np.cumsum(begins) - 1]
    is_first = lowest == corners
    return (np.cumsum(is_first) - 1)[lowest], np.flatnonzero(is_first)


def _points_of_sides(
    geometry: SceneGeometry, objects: Ids, vertex: NDArray[np.int32], n: Vectors
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(K,) the point of each side, and the first side of every point, in ascending order.

    Sides of one object share a point where their places are equal and their normals are, or nearly.
    """
    order, same = _equal_rows(np.ascontiguousarray(geometry.vertices)[vertex], objects[vertex])
    into = np.arange(len(vertex))
    for shift, places in _runs(same):
        a, b = order[places], order[places + shift]
        near = np.flatnonzero(length(take_rows(n, a) - take_rows(n, b)) < SAME_NORMAL)
        np.minimum.at(into, b[near], a[near])
    while (into[into] != into).any():
        into = into[into]
    is_first = into == np.arange(len(into))
    return (np.cumsum(is_first) - 1)[into], np.flatnonzero(is_first)


def _equal_rows(table: NDArray[np.float32], owner: Ids) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """An order in which equal rows of one owner follow each other, by index, and (N - 1,) whether each row
    equals the one before; zeros of either sign are equal."""
    bits = (table + F(0)).view(np.uint32).astype(np.uint64)
    key = owner.astype(np.uint64)
    for column in bits.T:
        key = (key ^ column) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    order = np.argsort(key, kind="stable")
    ordered = key.take(order)
    same = ordered[:-1] == ordered[1:]
    maybe = np.flatnonzero(same)
    a, b = order[maybe], order[maybe + 1]
    same[maybe] = (owner[a] == owner[b]) & (table[a] == table[b]).all(axis=1)
    return order, same


def _runs(same: NDArray[np.bool_]) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """Shifts from 1 on, each with the places whose follower at that shift is equal, while there are any."""
    run = np.concatenate([[0], np.cumsum(same)])
    for shift in range(1, min(MAX_COPIES, len(same)) + 1):
        places = np.flatnonzero(run[shift:] - run[:-shift] == shift)
        if not places.size:  # no run is that long, and none is longer
            return
        yield shift, places


def _random_keys(vertex: NDArray[np.int32], count: int) -> NDArray[np.uint32]:
    """(M,) key of each point's random numbers: its vertex, and which of the vertex's points it is."""
    order = np.argsort(vertex, kind="stable")
    ordered = vertex[order]
    rank = np.empty(len(vertex), np.int64)
    rank[order] = np.arange(len(vertex)) - np.searchsorted(ordered, ordered)
    return (vertex + rank * count).astype(np.uint32)


def _object_of_vertex(geometry: SceneGeometry) -> Ids:
    first = [placed.first_vertex for placed in geometry.placed]
    count = np.diff([*first, len(geometry.vertices)])
    return np.repeat(np.arange(len(first), dtype=np.int32), count)
