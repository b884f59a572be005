"""Where a bake asks for obscurance: every vertex of a scene, or points spread over its area.

At a vertex w is what pictures tend to there. Its rays are shared among the triangles around it by angle; each
starts just inside its own triangle, above it, and is mirrored at that triangle's plane. A vertex with several
shading normals (a hard edge, a seam) is asked once for each.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, column_major, cross, dot, length, take_rows, unit
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry
from illumcli.rays.interaction import facets, with_facet
from illumcli.rays.offsets import offset_ray_origins
from illumcli.rays.sampling import PLASTIC, hashed, stream, unit_interval
from illumcli.records import Record
from illumcli.visibility.hemisphere import Hemispheres

STARTS = 16
"""Places around a vertex from which its rays start."""
INSIDE = 2.0**-8
"""How far inside its triangle a ray of a vertex starts, as a share of the shorter edge there."""
SAME_NORMAL = 1e-4
"""Normals of one place that stand no farther apart [rad] are one: files write them with few digits."""
MOST_COPIES = 31
"""Normals of one place are compared with as many that follow them."""


class Surfaces(Record):
    """The meshes of a bake in their places, and how they are shaded."""

    world: SceneGeometry
    normals: CornerVectors  # unit shading normals of every corner


class Points(Record):
    """M points that cast rays."""

    world: SceneGeometry
    n: Vectors  # (M, 3) float32 unit shading normals
    position: Vectors  # (M, 3) float32 in radii
    number: NDArray[np.uint32]  # (M,) what their random numbers are keyed by
    thing: Ids  # (M,) object

    def hemispheres(self, lanes: NDArray[np.int64], offset: Floats) -> Hemispheres:
        """Where the rays of some points start, and about what.

        Parameters
        ----------
        offset : (K,) float64
            In [0, 1), random: where the division of a point's rays among its triangles begins.
        """
        raise NotImplementedError

    def above(self, clear: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(M,) True for points all of whose triangles are among the `clear` ones, (T,)."""
        raise NotImplementedError


# --- vertices -------------------------------------------------------------------------------------------


class Triangles(Record):
    """What a start needs of each of T triangles, float32; normals and heights without area are 0."""

    ng: Vectors  # (T, 3) unit
    edge: Floats  # (T,) longest edge, for slivers more (`offsets.effective_edge`), in radii
    height: Floats  # (T,) the least, in radii
    area: Floats  # (T,) twice the area, in radii^2


class Wedges(Record):
    """The parts of K triangles next to a corner, grouped by the point at that corner."""

    first: NDArray[np.int64]  # (M + 1,) first wedge of each point, and the end
    triangle: Ids  # (K,)
    vertex: NDArray[np.int32]  # (K, 3) of the corner itself, of the next and of the previous one
    angle: NDArray[np.float32]  # (K,) at the corner [rad]


class VertexPoints(Points):
    """Points at vertices, one for each normal."""

    wedges: Wedges
    triangles: Triangles

    def hemispheres(self, lanes: NDArray[np.int64], offset: Floats) -> Hemispheres:
        # the wedges of these points, and how many of the evenly spaced starts fall into each
        first, end = self.wedges.first[lanes], self.wedges.first[lanes + 1]
        count = end - first
        ends = np.cumsum(count)
        wedge = np.repeat(first - ends + count, count) + np.arange(ends[-1])
        angle = self.wedges.angle[wedge].astype(np.float64)
        upto = np.cumsum(angle)
        before = np.repeat((upto - angle)[ends - count], count)
        whole = np.repeat(upto[ends - 1], count) - before
        slot = np.ceil((upto - before) / whole * STARTS - np.repeat(offset, count)).clip(0, STARTS)
        slot[ends - 1] = STARTS
        previous = np.concatenate([[0], slot[:-1]])
        previous[ends - count] = 0
        own = np.repeat(np.arange(len(wedge)), (slot - previous).astype(np.int64))

        # the starts, at the angles that their numbers say
        place = np.tile(np.arange(STARTS), len(lanes)) + np.repeat(offset, STARTS)
        turn = place / STARTS * whole[own] - (upto - before - angle)[own]
        turn = turn.clip(0, angle[own]).astype(F)
        base, ahead, aside, ng = self._fans(wedge)
        origins = take_rows(base, own)
        origins += np.cos(turn)[:, None] * take_rows(ahead, own)
        origins += np.sin(turn)[:, None] * take_rows(aside, own)
        return Hemispheres(take_rows(self.n, lanes), origins, take_rows(ng, own))

    def _fans(self, wedge: NDArray[np.int64]) -> tuple[Vectors, Vectors, Vectors, Vectors]:
        """Of some wedges: the corner, lifted off its triangle, and two steps inside, along the next edge and
        at right angles to it; the triangle's normal: (K, 3) float32 each."""
        vertex, triangle = self.wedges.vertex[wedge], self.wedges.triangle[wedge]
        corner, following, last = (
            column_major(take_rows(self.world.vertices, vertex[:, k]), np.float64) for k in range(3)
        )
        of = self.triangles
        ng, edge, height = (take_rows(values, triangle) for values in (of.ng, of.edge, of.height))
        ahead, back = following - corner, last - corner
        reach = np.minimum(INSIDE * np.sqrt(np.minimum(dot(ahead, ahead), dot(back, back))), height / 4)
        normal = ng.astype(np.float64)
        along = unit(ahead - dot(ahead, normal)[:, None] * normal) * reach[:, None]
        return (
            offset_ray_origins(corner, ng, edge),
            column_major(along, F),
            column_major(cross(normal, along), F),
            ng,
        )

    def above(self, clear: NDArray[np.bool_]) -> NDArray[np.bool_]:
        if not len(self.number):
            return np.zeros(0, bool)
        return np.logical_and.reduceat(clear[self.wedges.triangle], self.wedges.first[:-1])


class Sides(Record):
    """What K vertices have on one smooth side: a vertex and a normal, and the corners that have both."""

    vertex: NDArray[np.int32]  # (K,)
    row: NDArray[np.int64]  # (K,) of the points
    angle: NDArray[np.float64]  # (K,) of all its corners [rad]


class Vertices(Record):
    """The corners of a world and the points they take their values from."""

    points: VertexPoints
    row: NDArray[np.int64]  # (C,) row of `points` for each polygon corner, -1 where it has none
    sides: Sides
    count: int  # vertices
    unreferenced: int  # vertices that no polygon names
    without_normal: int  # vertices of polygons without area alone
    copies: int  # pairs of vertex and normal that take the value of another at the same place


def vertex_points(surfaces: Surfaces) -> Vertices:
    """A point for every vertex and shading normal; those of one object at one place that have the same normal
    are one point, so that a seam of uv does not show, and a hard edge stays hard."""
    world, normals = surfaces.world, surfaces.normals
    vertex, starts = _corners(world)
    triangles = _triangles(world)
    owner, wedge_triangle, wedge_vertex, angle = _wedges(world, vertex, starts, triangles)

    # the corners that can cast rays: those with a normal and a triangle beside them
    own = normals.index >= 0
    n = (
        take_rows(normals.values, np.maximum(normals.index, 0))
        if len(normals.values)
        else np.zeros((0, 3), F)
    )
    corner_angle = np.bincount(owner, angle, len(vertex)).astype(np.float64)
    has = own & (dot(n, n) > 0.25) & (corner_angle > 0)
    casting = np.flatnonzero(has)
    thing = _thing_of_vertex(world)
    side, first_corner = _sides(vertex[casting], take_rows(n, casting))
    first_corner = casting[first_corner]
    into, first = _points_of(world, thing, vertex[first_corner], take_rows(n, first_corner))
    row = np.full(len(vertex), -1, np.int64)
    row[casting] = into[side]

    # their wedges, point by point
    order = np.argsort(row[owner], kind="stable")
    order = order[np.searchsorted(row[owner][order], 0) :]
    begins = np.searchsorted(row[owner][order], np.arange(len(first) + 1))
    wedges = Wedges(begins, wedge_triangle[order], wedge_vertex[order], angle[order].astype(F))

    corner = first_corner[first]
    at = vertex[corner]
    points = VertexPoints(
        world,
        column_major(take_rows(n, corner), F),
        column_major(take_rows(world.vertices, at), F),
        _numbers(at, len(world.vertices)),
        thing[at],
        wedges,
        triangles,
    )
    used, asked = np.zeros(len(world.vertices), bool), np.zeros(len(world.vertices), bool)
    used[vertex], asked[vertex[casting]] = True, True
    angles = np.bincount(side, corner_angle[casting], len(first_corner)).astype(np.float64)
    sides = Sides(vertex[first_corner], into, angles)
    return Vertices(
        points,
        row,
        sides,
        len(world.vertices),
        int((~used).sum()),
        int((used & ~asked).sum()),
        len(first_corner) - len(first),
    )


def _corners(world: SceneGeometry) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """(C,) vertex number of every polygon corner, and (P + 1,) first corner of every polygon and the end."""
    vertex = [placed.mesh.corners + np.int32(placed.first_vertex) for placed in world.placed]
    starts = [placed.mesh.starts[1:] + np.int64(placed.first_corner) for placed in world.placed]
    return np.concatenate([np.zeros(0, np.int32), *vertex]), np.concatenate([np.zeros(1, np.int64), *starts])


def _triangles(world: SceneGeometry) -> Triangles:
    every = np.arange(len(world.triangles), dtype=np.int32)
    zero = np.zeros(len(every), F)
    facet = facets(world, every, zero, zero, np.zeros((len(every), 3), F))
    corner = [column_major(take_rows(world.vertices, world.triangles[:, k]), np.float64) for k in range(3)]
    edges = [corner[k - 2] - corner[k] for k in range(3)]
    area = length(cross(edges[0], edges[1]))
    longest = np.maximum.reduce([length(edge) for edge in edges])
    height = np.divide(area, longest, out=np.zeros_like(area), where=longest > 0)
    return Triangles(facet.ng, facet.edge, height.astype(F), area.astype(F))


def _wedges(
    world: SceneGeometry, vertex: NDArray[np.int32], starts: NDArray[np.int64], triangles: Triangles
) -> tuple[NDArray[np.int64], Ids, NDArray[np.int32], NDArray[np.float64]]:
    """The wedges of all corners: (K,) corner, (K,) triangle, (K, 3) vertices, (K,) angle.

    A triangle has one at each of its corners. A corner that all triangles at it leave without area, because
    its polygon was cut there, has its polygon's own angle on the polygon's largest triangle.
    """
    # at the corners of triangles that have an area
    ng, area = triangles.ng, triangles.area
    sound = np.flatnonzero(area > 0)
    triangle, corner = world.triangles[sound], world.corners[sound]
    turned = [np.roll(triangle, -k, axis=1) for k in range(3)]
    vertices = np.concatenate(turned) if len(sound) else np.zeros((0, 3), np.int32)
    owner = np.concatenate([corner[:, k] for k in range(3)]).astype(np.int64)
    of = np.tile(sound.astype(np.int32), 3)
    angle = np.concatenate([_angles(world, each, take_rows(ng, sound)) for each in turned])

    # and at those that have none, between the nearest corners of their polygon that lie elsewhere
    alone = np.ones(len(vertex), bool)
    alone[owner] = False
    largest = np.full(len(starts) - 1, -1, np.int64)
    by_area = sound[np.argsort(area[sound], kind="stable")]
    largest[world.polygons[by_area]] = by_area
    polygon = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    left = np.flatnonzero(alone & (largest[polygon] >= 0))
    if left.size:
        ends = [_elsewhere(world, vertex, starts, polygon, left, step) for step in (1, -1)]
        own = largest[polygon[left]].astype(np.int32)
        more = np.stack([vertex[left], vertex[ends[0]], vertex[ends[1]]], axis=1)
        forwards = _runs_forwards(world, own, starts, polygon[left])
        more[~forwards] = more[~forwards][:, [0, 2, 1]]
        owner, of = np.concatenate([owner, left]), np.concatenate([of, own])
        vertices = np.concatenate([vertices, more])
        angle = np.concatenate([angle, _angles(world, more, take_rows(ng, own))])
    return owner, of, vertices, angle


def _angles(world: SceneGeometry, vertex: NDArray[np.int32], ng: Vectors) -> NDArray[np.float64]:
    """(K,) from the next corner to the previous one about the normal, from 0 to a whole turn [rad]."""
    corner, following, last = (
        column_major(take_rows(world.vertices, vertex[:, k]), np.float64) for k in range(3)
    )
    ahead, back = following - corner, last - corner
    angle: NDArray[np.float64] = np.arctan2(dot(cross(ahead, back), ng.astype(np.float64)), dot(ahead, back))
    return np.maximum(np.where(angle < -1e-6, angle + 2 * np.pi, angle), 1e-6)


def _elsewhere(
    world: SceneGeometry,
    vertex: NDArray[np.int32],
    starts: NDArray[np.int64],
    polygon: NDArray[np.int64],
    corner: NDArray[np.int64],
    step: int,
) -> NDArray[np.int64]:
    """(K,) the next corner of the same polygon, `step` by `step`, that lies at another place."""
    first = starts[polygon[corner]]
    size = starts[polygon[corner] + 1] - first
    found = first + (corner - first + step) % size
    for _ in range(int(size.max(initial=0))):
        same = (world.vertices[vertex[found]] == world.vertices[vertex[corner]]).all(axis=1)
        if not same.any():
            break
        found = np.where(same, first + (found - first + step) % size, found)
    return found


def _runs_forwards(
    world: SceneGeometry, triangle: Ids, starts: NDArray[np.int64], polygon: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """(K,) True where a triangle's corners follow each other as those of its polygon, False where an object
    is mirrored and they run the other way round."""
    a, b, c = (world.corners[triangle, k] - starts[polygon] for k in range(3))
    return ((a < b) & (b < c)) | ((b < c) & (c < a)) | ((c < a) & (a < b))


def _sides(vertex: NDArray[np.int32], n: Vectors) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(C,) the side of each corner, those of one vertex and equal normals, and the first corner of each side,
    in ascending order."""
    # most vertices have one normal: that of their first corner
    corners = np.arange(len(vertex))
    first = np.zeros(vertex.max(initial=-1) + 1, np.int64)
    first[vertex[::-1]] = corners[::-1]
    lowest = first[vertex]
    others = np.flatnonzero((n != take_rows(n, lowest)).any(axis=1))
    if others.size:
        order, same = _equal_rows(np.ascontiguousarray(take_rows(n, others)), vertex[others])
        begins = np.append(True, ~same)
        lowest[others[order]] = others[order][begins][np.cumsum(begins) - 1]
    is_first = lowest == corners
    return (np.cumsum(is_first) - 1)[lowest], np.flatnonzero(is_first)


def _points_of(
    world: SceneGeometry, thing: Ids, vertex: NDArray[np.int32], n: Vectors
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(K,) the point that each side belongs to, and the first side of every point, in ascending order.

    Sides of one object belong to one point where their places are equal and their normals are, or nearly.
    """
    order, same = _equal_rows(np.ascontiguousarray(world.vertices)[vertex], thing[vertex])
    into = np.arange(len(vertex))
    for shift, lanes in _runs(same):
        a, b = order[lanes], order[lanes + shift]
        near = np.flatnonzero(length(take_rows(n, a) - take_rows(n, b)) < SAME_NORMAL)
        np.minimum.at(into, b[near], a[near])
    while (into[into] != into).any():
        into = into[into]
    is_first = into == np.arange(len(into))
    return (np.cumsum(is_first) - 1)[into], np.flatnonzero(is_first)


def _equal_rows(table: NDArray[np.float32], owner: Ids) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Rows in an order in which equal ones of one object follow each other, by number, and (N - 1,) whether
    each equals the one before; zeros of either sign are equal."""
    bits = (table + F(0)).view(np.uint32).astype(np.uint64)
    key = owner.astype(np.uint64)
    for column in bits.T:
        key = (key ^ column) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    order = np.argsort(key, kind="stable")
    a, b = order[:-1], order[1:]
    same = (key[a] == key[b]) & (owner[a] == owner[b]) & (table[a] == table[b]).all(axis=1)
    return order, same


def _runs(same: NDArray[np.bool_]) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """Shifts from 1 on, and the lanes whose follower by so many is at the same place, while there are any."""
    run = np.concatenate([[0], np.cumsum(same)])
    for shift in range(1, min(MOST_COPIES, len(same)) + 1):
        lanes = np.flatnonzero(run[shift:] - run[:-shift] == shift)
        if not lanes.size:  # no run is that long, and none is longer
            return
        yield shift, lanes


def _numbers(vertex: NDArray[np.int32], count: int) -> NDArray[np.uint32]:
    """(M,) what random numbers are keyed by: the vertex, and which of its points each is."""
    order = np.argsort(vertex, kind="stable")
    ordered = vertex[order]
    rank = np.empty(len(vertex), np.int64)
    rank[order] = np.arange(len(vertex)) - np.searchsorted(ordered, ordered)
    return (vertex + rank * count).astype(np.uint32)


def _thing_of_vertex(world: SceneGeometry) -> Ids:
    first = [placed.first_vertex for placed in world.placed]
    count = np.diff([*first, len(world.vertices)])
    return np.repeat(np.arange(len(first), dtype=np.int32), count)


# --- points over the area -------------------------------------------------------------------------------


class AreaPoints(Points):
    """Points spread evenly over triangles, for values that are fitted to them."""

    origins: Vectors  # (M, 3) float32 off the surface, in radii
    ng: Vectors  # (M, 3) float32 unit normals of their triangles
    triangle: Ids  # (M,)
    u: NDArray[np.float64]  # (M,) weight of corner 1
    v: NDArray[np.float64]  # (M,) weight of corner 2
    area: NDArray[np.float64]  # (M,) of the surface each stands for, in radii^2

    def hemispheres(self, lanes: NDArray[np.int64], offset: Floats) -> Hemispheres:
        return Hemispheres(self.n, self.origins, self.ng).take(lanes)

    def above(self, clear: NDArray[np.bool_]) -> NDArray[np.bool_]:
        return clear[self.triangle]


def area_points(surfaces: Surfaces, count: int, seed: int) -> AreaPoints:
    """About `count` points on triangles that have an area: one each, and more by area.

    On each triangle they follow the R2 sequence (Roberts 2018), shifted by a hash of its number.
    """
    # how many on each triangle
    world, normals = surfaces.world, surfaces.normals
    corner = [column_major(take_rows(world.vertices, world.triangles[:, k]), np.float64) for k in range(3)]
    area = length(cross(corner[1] - corner[0], corner[2] - corner[0])) / 2
    total = area.sum()
    share = np.ceil(area * (count / total)) if total > 0 else np.zeros(len(area))
    size = share.astype(np.int64)
    triangle = np.repeat(np.arange(len(size), dtype=np.int32), size)

    # where: points beyond the diagonal of the unit square fold back onto the triangle
    within = np.arange(len(triangle)) - np.repeat(np.cumsum(size) - size, size)
    key = stream(seed, "area")
    shift = [unit_interval(hashed(key + k, np.arange(len(size), dtype=np.uint32)))[triangle] for k in (0, 1)]
    a, b = (within / PLASTIC + shift[0]) % 1, (within / PLASTIC**2 + shift[1]) % 1
    over = a + b > 1
    a, b = np.where(over, 1 - a, a), np.where(over, 1 - b, b)

    # their shading normals; the triangle's own where there is none
    facet = facets(world, triangle, a, b, np.zeros((len(triangle), 3), F))
    index = [normals.index.take(world.corners[:, k].take(triangle)) for k in range(3)]
    parts = [
        weight.astype(F)[:, None] * np.where(row[:, None] >= 0, take_rows(normals.values, row), F(0))
        for weight, row in zip((1 - a - b, a, b), index, strict=True)
    ] if len(normals.values) else [np.zeros_like(facet.ng)] * 3  # fmt: skip
    n = with_facet(unit(parts[0] + parts[1] + parts[2]), facet.ng)
    return AreaPoints(
        world,
        column_major(n, F),
        column_major(facet.position, F),
        np.arange(len(triangle), dtype=np.uint32),
        world.objects[triangle],
        offset_ray_origins(facet.position, facet.ng, facet.edge),
        facet.ng,
        triangle,
        a,
        b,
        (area / np.maximum(size, 1))[triangle],
    )
