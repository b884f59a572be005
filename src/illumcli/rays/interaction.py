"""Surface interactions: what shading needs of a hit, as position, planes, normals, uv, tangents and ids."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, column_major, cross, dot, length, take_rows, unit
from illumcli.geometry.planar import PlanarPolygons
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry
from illumcli.geometry.transforms import cofactors
from illumcli.rays.camera import Rays
from illumcli.rays.corner_weights import Corners, CornerWeights, MeanCorners, TriangleCorners
from illumcli.rays.embree import Tracer
from illumcli.rays.offsets import effective_edge
from illumcli.records import Record
from illumcli.render_space import RenderSpace


class Hits(Record):
    """The samples of a tile that see a surface; every surface buffer has these M lanes."""

    sample: Ids  # (M,) which sample of the tile, ascending
    triangle: Ids  # (M,)
    u: Floats  # (M,) float32 weight of corner 1
    v: Floats  # (M,) float32 weight of corner 2


def hits(tracer: Tracer, rays: Rays) -> Hits:
    """The samples whose rays hit a triangle, and where."""
    closest = tracer.closest(rays.origins, rays.directions)
    sample = np.flatnonzero(closest.triangle >= 0).astype(np.int32)
    return Hits(sample, *(getattr(closest, name).take(sample) for name in ("triangle", "u", "v")))


class SurfaceInteraction(Record):
    """Where hits lie on their triangles, and the triangles' own planes."""

    position: NDArray[np.float64]  # (M, 3) in radii, on the triangle the ray core sees
    ng: Vectors  # (M, 3) float32 unit facet normal, on the side the eye sees
    edge: Floats  # (M,) float32 longest edge, for slivers more (`offsets.effective_edge`), in radii
    back_facing: NDArray[np.bool_]  # (M,) the eye sees the back: normals are turned over


def interaction(geometry: SceneGeometry, rays: Rays, hits: Hits) -> SurfaceInteraction:
    """Positions and planes of the hits, seen along their rays."""
    towards_eye = -take_rows(rays.directions, hits.sample)
    return interact(geometry, hits.triangle, hits.u, hits.v, towards_eye)


def interact(
    geometry: SceneGeometry, triangle: Ids, u: Floats, v: Floats, towards_eye: Vectors
) -> SurfaceInteraction:
    """Positions and planes of hits, from float64 edges of the float32 vertices the ray core sees."""
    v0, e1, e2 = (
        column_major(take_rows(geometry.vertices, geometry.triangles[:, k].take(triangle)), np.float64)
        for k in range(3)
    )
    e1 -= v0
    e2 -= v0
    sides = column_major(e1, F), column_major(e2, F), column_major(e2 - e1, F)
    edge = np.sqrt(np.maximum(np.maximum(*(dot(side, side) for side in sides[:2])), dot(sides[2], sides[2])))
    normal = cross(e1, e2)
    area = length(normal)
    back_facing = dot(normal, towards_eye) < 0
    scale = np.divide(1 - 2 * back_facing.astype(np.float64), area, out=np.zeros_like(area), where=area > 0)
    normal *= scale[:, None]
    position = v0
    position += np.multiply(e1, u[:, None], out=e1)
    position += np.multiply(e2, v[:, None], out=e2)
    return SurfaceInteraction(position, column_major(normal, F), effective_edge(edge, area), back_facing)


class ShadingContext(Record):
    """The surface at M hits, as interpolation needs it."""

    geometry: SceneGeometry
    weights: CornerWeights
    interaction: SurfaceInteraction
    normals: CornerVectors | None = None
    """Shading normals at corners; None where every object is flat."""

    def take(self, index: NDArray[Any]) -> ShadingContext:
        """The context of some of the hits, which ascend."""
        if len(index) == len(self.weights):
            return self
        interaction = SurfaceInteraction(
            *(take_rows(values, index) for values in vars(self.interaction).values())
        )
        return ShadingContext(self.geometry, self.weights.take(index), interaction, self.normals)


def facing(n: Vectors, back_facing: NDArray[np.bool_]) -> Vectors:
    """`n`, turned over where the eye sees the back."""
    return n * (1 - 2 * back_facing.astype(n.dtype))[:, None]


def corner_rows(geometry: SceneGeometry, triangle: Ids, table: CornerVectors) -> tuple[Ids, Ids, Ids]:
    """Rows of `table` at the three corners of each hit triangle."""
    a, b, c = (table.index.take(geometry.corners[:, k].take(triangle)) for k in range(3))
    return a, b, c


def geometric_normal(
    hits: Hits, interaction: SurfaceInteraction, planar_polygons: PlanarPolygons | None = None
) -> Vectors:
    """(M, 3) float32 unit normal of each hit's polygon, on the side the eye sees.

    Newell's normal of a planar polygon, else the triangle's. Rays keep to the triangle's, which they leave.
    """
    row = np.zeros(0, np.int32) if planar_polygons is None else planar_polygons.row.take(hits.triangle)
    planar = np.flatnonzero(row >= 0)
    if planar_polygons is None or not planar.size:
        return interaction.ng
    normal, ng = take_rows(planar_polygons.normal, row.take(planar)), take_rows(interaction.ng, planar)
    out = interaction.ng.copy(order="F")
    out[planar] = facing(normal, dot(normal, ng) < 0)
    return out


def interpolated(context: ShadingContext) -> Vectors:
    """(M, 3) unit normal, interpolated linearly and made unit at every sample (Phong 1975).

    The facet's own where the interpolated one vanishes. On the side the eye sees.
    """
    interaction = context.interaction
    if context.normals is None:
        return interaction.ng
    n = unit(context.weights.interpolate(context.geometry, context.normals))
    return with_facet(facing(n, interaction.back_facing), interaction.ng)


def with_facet(n: Vectors, ng: Vectors) -> Vectors:
    """`n`, or the facet's normal on lanes where `n` vanishes."""
    gone = np.flatnonzero(~(dot(n, n) > 0.25))
    if gone.size:
        n[gone] = ng[gone]
    return n


def quadratic(context: ShadingContext) -> Vectors:
    """(M, 3) unit normal, quadratic along every edge.

    Along an edge delta from n0 to n1 the normal is (1 - s) n0 + s n1 - s (1 - s) b with
    b = 3 ((n0 + n1).delta / delta.delta) delta, so that on average it stays at right angles to the edge: an
    inflection between two equal normals shows, which linear interpolation loses. Over a triangle the edge
    terms are weighed by products w_i w_j of the weights of their ends, over a planar polygon of more corners
    by w_i w_j / (w_i + w_j): each reduces to the edge's own form there, and between two parallel edges of a
    quad the second is linear.

    References
    ----------
    van Overveld, C. W. A. M. and Wyvill, B. (1997). Phong normal interpolation revisited. ACM TOG 16(4).
    """
    geometry, weights, interaction = context.geometry, context.weights, context.interaction
    normals = context.normals
    if normals is None:
        return interaction.ng
    n = column_major(weights.interpolate(geometry, normals))
    for group in weights.groups:

        def corner(k: int, group: Corners = group) -> Corner:
            end = take_rows(normals.values, normals.index.take(group.corner(geometry, k)))
            return take_rows(geometry.vertices, group.vertex(geometry, k)), end, group.end_weight(k)

        share = np.multiply if isinstance(group, TriangleCorners) else between
        if group.lane is None:
            bend(n, group.count, corner, share)
        else:
            part = take_rows(n, group.lane)
            bend(part, group.count, corner, share)
            n[group.lane] = part
    return with_facet(facing(unit(n), interaction.back_facing), interaction.ng)


Corner: TypeAlias = tuple[Vectors, Vectors, Floats]
"""(M, 3) place of a corner, its unit normal, (M,) its weight."""


def between(first: Floats, last: Floats) -> Floats:
    """(M,) w_i w_j / (w_i + w_j) for the weights of an edge's ends; 0 where one is not positive."""
    product = np.maximum(first, 0) * np.maximum(last, 0)
    return np.divide(product, first + last, out=np.zeros_like(product), where=product > 0)


def bend(
    n: Vectors,
    count: int,
    corner: Callable[[int], Corner],
    share: Callable[[Floats, Floats], Floats] = np.multiply,
) -> None:
    """Take the quadratic terms of a polygon's edges off its (M, 3) linear normals `n`, which are not unit.

    `share` is how much of an edge's term there is, by the weights of its ends.
    """
    first = last = corner(0)
    for k in range(1, count + 1):
        following = corner(k) if k < count else first
        delta = following[0] - last[0]
        square = dot(delta, delta)
        slope = np.divide(
            3 * dot(last[1] + following[1], delta), square, out=np.zeros_like(square), where=square > 0
        )
        n -= (share(last[2], following[2]) * slope)[:, None] * delta
        last = following


def uv(geometry: SceneGeometry, uvs: CornerVectors, hits: Hits) -> NDArray[np.float32]:
    """(M, 2) texture coordinates, linear on every triangle; 0 where a mesh has none."""
    return _with_all(geometry, uvs, TriangleCorners(None, hits.triangle, hits.u, hits.v))


def uv_at(geometry: SceneGeometry, uvs: CornerVectors, weights: CornerWeights) -> NDArray[np.float32]:
    """(M, 2) texture coordinates; 0 where a mesh has none.

    Linear on every triangle, as exporters and bakers have them; points that stand for polygons have the mean.
    """
    out = _with_all(geometry, uvs, weights.hits)
    for group in weights.groups:
        if isinstance(group, MeanCorners):
            lane = slice(None) if group.lane is None else group.lane
            out[lane] = _with_all(geometry, uvs, group)
    return out


def _with_all(geometry: SceneGeometry, uvs: CornerVectors, corners: Corners) -> NDArray[np.float32]:
    """(m, 2) means by weight; 0 where a corner has none."""
    index = [uvs.index.take(corners.corner(geometry, k)) for k in range(corners.count)]
    has = np.minimum.reduce(index) >= 0
    if not has.any():
        return np.zeros((len(has), 2), F, order="F")
    found = corners.mean(lambda k: take_rows(uvs.values, index[k]))
    return np.asarray(np.where(has[:, None], found, F(0)))


def uv_tangents(geometry: SceneGeometry, uvs: CornerVectors) -> CornerVectors:
    """Where u grows, at every corner.

    The mean, by angle, of the triangles around that share vertex, uv and the handedness of their uv, so that
    the grain of a smooth surface is smooth up to its seams. Zero where there are no uv, or flat ones.
    """
    points = [take_rows(geometry.vertices, corner).astype(np.float64) for corner in geometry.triangles.T]
    at = corner_rows(geometry, np.arange(len(geometry.triangles), dtype=np.int32), uvs)
    along, hand = _along_u(points, at, uvs)
    groups, parts = [], []
    for k in range(3):
        groups.append((geometry.triangles[:, k] * (len(uvs.values) + np.int64(1)) + at[k] + 1) * 3 + hand)
        e1, e2 = points[k - 2] - points[k], points[k - 1] - points[k]
        parts.append(along * np.arctan2(length(cross(e1, e2)), dot(e1, e2))[:, None])
    _, index = np.unique(np.stack(groups, axis=1), return_inverse=True)
    weights = np.stack(parts, axis=1).reshape(-1, 3)
    sums: Vectors = np.stack(
        [np.bincount(index.ravel(), part) for part in weights.T], axis=1, dtype=np.float64
    )
    none = np.zeros((1, 3))  # of corners that the cut skipped
    corner = np.full(len(uvs.index), len(sums), np.int32)
    corner[geometry.corners.ravel()] = index.ravel()
    return CornerVectors(column_major(np.concatenate([unit(sums), none]), F), corner)


def _along_u(
    points: Sequence[Vectors], at: Sequence[Ids], uvs: CornerVectors
) -> tuple[Vectors, NDArray[np.int64]]:
    """(T, 3) unit vectors where u grows on each triangle, and (T,) the handedness of its uv: 0, 1 flat, 2."""
    if not len(uvs.values):
        return np.zeros_like(points[0]), np.ones(len(points[0]), np.int64)
    t0, t1, t2 = (take_rows(uvs.values, np.maximum(index, 0)).astype(np.float64) for index in at)
    a, b = t1 - t0, t2 - t0
    has = (at[0] >= 0) & (at[1] >= 0) & (at[2] >= 0)
    hand = np.where(has, np.sign(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), 0)
    e1, e2 = points[1] - points[0], points[2] - points[0]
    way: Vectors = b[:, 1][:, None] * e1 - a[:, 1][:, None] * e2
    return unit(way) * hand[:, None], hand.astype(np.int64) + 1


def world_position(render_space: RenderSpace, interaction: SurfaceInteraction) -> Vectors:
    """(M, 3) float32 position [scene units]."""
    return column_major(render_space.to_world(interaction.position), F)


def object_id(geometry: SceneGeometry, hits: Hits) -> NDArray[np.uint32]:
    """(M,) number of the object, from 1."""
    return (geometry.objects.take(hits.triangle) + 1).astype(np.uint32)


def triangle_id(hits: Hits) -> NDArray[np.uint32]:
    """(M,) number of the triangle, from 1."""
    return (hits.triangle + 1).astype(np.uint32)


def rings(
    matrix: NDArray[np.float64], axis: Sequence[float], centre: ArrayLike, position: Vectors
) -> Vectors:
    """(M, 3) unit direction of the ring about an axis through each point; zero on the axis.

    Parameters
    ----------
    matrix : (3, 3)
        From the object's own directions, in which axis and rings are meant, to those of the world: where it
        stretches unevenly, rings become ellipses.
    centre : (3,)
        A point on the axis, in the world, as `position` is.
    """
    own = (position - np.asarray(centre)) @ cofactors(matrix)  # by the inverse, times the determinant
    ring = np.cross(axis, own) @ matrix.T
    return unit(ring * np.sign(np.linalg.det(matrix)))


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
