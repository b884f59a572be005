"""Hits to what shading asks of them: position, facet, view, normal, depth, uv, tangent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Ids, Lanes, Vectors, columns, cross, dot, length, rows, unit
from illumcli.geometry.assemble import CornerVectors, World
from illumcli.rays.tracer import Closest


@dataclass(frozen=True, slots=True, eq=False)
class Hits:
    """The samples of a tile that see a surface; every surface buffer has these M lanes."""

    lane: Ids  # (M,) which sample of the tile
    triangle: Ids  # (M,)
    u: Lanes  # (M,) float32 weight of corner 1
    v: Lanes  # (M,) float32 weight of corner 2
    distance: Lanes  # (M,) float32 from the ray's origin, in radii


def seen(closest: Closest) -> Hits:
    """The hits among `closest`, packed."""
    lane = np.flatnonzero(closest.triangle >= 0).astype(np.int32)
    return Hits(
        lane,
        *(getattr(closest, name).take(lane) for name in ("triangle", "u", "v", "distance")),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Facets:
    """Where hits lie on their triangles, and the triangles' own planes."""

    position: NDArray[np.float64]  # (M, 3) in radii, on the triangle the ray core sees
    ng: Vectors  # (M, 3) float32 unit facet normal, on the side the eye sees
    edge: Lanes  # (M,) float32 longest edge, in radii
    behind: NDArray[np.bool_]  # (M,) the eye sees the back: normals are turned over


def facets(world: World, triangle: Ids, u: Lanes, v: Lanes, towards_eye: Vectors) -> Facets:
    """Positions and planes of hits, from float64 edges of the float32 vertices the ray core sees."""
    v0, v1, v2 = (
        columns(rows(world.vertices, world.triangles[:, k].take(triangle)), np.float64) for k in range(3)
    )
    e1, e2 = v1 - v0, v2 - v0
    position = v0 + u[:, None] * e1 + v[:, None] * e2
    ng = unit(cross(e1, e2))
    edge = np.sqrt(np.maximum(np.maximum(dot(e1, e1), dot(e2, e2)), dot(e2 - e1, e2 - e1)))
    behind = dot(ng, towards_eye) < 0
    return Facets(position, columns(facing(ng, behind), F), edge.astype(F), behind)


def facing(n: Vectors, behind: NDArray[np.bool_]) -> Vectors:
    """`n`, turned over where the eye sees the back."""
    return n * np.where(behind, -1, 1).astype(n.dtype)[:, None]


def corner_rows(world: World, triangle: Ids, table: CornerVectors) -> tuple[Ids, Ids, Ids]:
    """Rows of `table` at the three corners of each hit triangle."""
    a, b, c = (table.index.take(world.corners[:, k].take(triangle)) for k in range(3))
    return a, b, c


def linear(table: CornerVectors, at: tuple[Ids, Ids, Ids], u: Lanes, v: Lanes) -> Vectors:
    """(M, k) barycentric interpolation of three rows of `table`."""
    a, b, c = (rows(table.values, index) for index in at)
    return (1 - u - v)[:, None] * a + u[:, None] * b + v[:, None] * c


def interpolated(
    world: World, normals: CornerVectors, triangle: Ids, u: Lanes, v: Lanes, facet: Facets
) -> Vectors:
    """(M, 3) unit normal, interpolated linearly and made unit at every sample (Phong 1975).

    The facet's own where the interpolated one vanishes. On the side the eye sees.
    """
    n = unit(linear(normals, corner_rows(world, triangle, normals), u, v))
    n = facing(n, facet.behind)
    return with_facet(n, facet.ng)


def with_facet(n: Vectors, ng: Vectors) -> Vectors:
    """`n`, or the facet's normal on lanes where `n` vanishes."""
    gone = np.flatnonzero(~(dot(n, n) > 0.25))
    if gone.size:
        n[gone] = ng[gone]
    return n


def quadratic(
    world: World, normals: CornerVectors, triangle: Ids, u: Lanes, v: Lanes, facet: Facets
) -> Vectors:
    """(M, 3) unit normal, quadratic along every edge.

    Along an edge delta from n0 to n1 the normal is (1 - s) n0 + s n1 - s (1 - s) b with
    b = 3 ((n0 + n1).delta / delta.delta) delta, so that on average it stays at right angles to the edge: an
    inflection between two equal normals shows, which linear interpolation loses. Over a triangle the
    edge terms are weighed by products of barycentric weights, which reduces to the edge's own form there.

    References
    ----------
    van Overveld, C. W. A. M. and Wyvill, B. (1997). Phong normal interpolation revisited. ACM TOG 16(4).
    """
    corners = [rows(world.vertices, world.triangles[:, k].take(triangle)) for k in range(3)]
    ends = [rows(normals.values, index) for index in corner_rows(world, triangle, normals)]
    n = bent(corners, ends, (1 - u - v, u, v))
    return with_facet(facing(unit(n), facet.behind), facet.ng)


def bent(corners: Sequence[Vectors], ends: Sequence[Vectors], weights: Sequence[Lanes]) -> Vectors:
    """(M, 3) quadratic normal, not unit, of triangles with these corners and unit corner normals."""
    n = weights[0][:, None] * ends[0] + weights[1][:, None] * ends[1] + weights[2][:, None] * ends[2]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        delta = corners[j] - corners[i]
        square = dot(delta, delta)
        slope = np.divide(
            3 * dot(ends[i] + ends[j], delta), square, out=np.zeros_like(square), where=square > 0
        )
        n -= (weights[i] * weights[j] * slope)[:, None] * delta
    return n


def uv(world: World, uvs: CornerVectors, triangle: Ids, u: Lanes, v: Lanes) -> NDArray[np.float32]:
    """(M, 2) texture coordinates; 0 where a mesh has none."""
    at = corner_rows(world, triangle, uvs)
    out = np.zeros((len(triangle), 2), F, order="F")
    has = np.flatnonzero((at[0] >= 0) & (at[1] >= 0) & (at[2] >= 0))
    if has.size:
        a, b, c = (index.take(has) for index in at)
        out[has] = linear(uvs, (a, b, c), u.take(has), v.take(has))
    return out


def along_u(world: World, uvs: CornerVectors, triangle: Ids) -> Vectors:
    """(M, 3) direction in which u grows on each triangle; zero where it has no uv or they are flat."""
    v0, v1, v2 = (rows(world.vertices, world.triangles[:, k].take(triangle)) for k in range(3))
    at = corner_rows(world, triangle, uvs)
    if not len(uvs.values):
        return np.zeros((len(triangle), 3), F, order="F")
    t0, t1, t2 = (rows(uvs.values, np.maximum(index, 0)) for index in at)
    has = (at[0] >= 0) & (at[1] >= 0) & (at[2] >= 0)
    a, b = t1 - t0, t2 - t0
    twice = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    sign = np.where(has, np.sign(twice), 0).astype(F)
    return unit(sign[:, None] * (b[:, 1][:, None] * (v1 - v0) - a[:, 1][:, None] * (v2 - v0)))


def tangent(n: Vectors, grain: Vectors) -> Vectors:
    """(M, 3) unit `grain` made perpendicular to `n`; any perpendicular where it is parallel or zero."""
    t = grain - dot(grain, n)[:, None] * n
    size = length(t)
    weak = np.flatnonzero(~(size > 1e-4))
    if weak.size:
        m = n[weak]
        axis = np.zeros_like(m)
        axis[np.arange(len(m)), np.argmin(np.abs(m), axis=1)] = 1
        t[weak] = axis - dot(axis, m)[:, None] * m
    return unit(t)
