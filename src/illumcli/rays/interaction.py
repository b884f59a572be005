"""Surface interactions: position, normals, uv, tangents and ids of hits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from illumcli.arrays import (
    F,
    Floats,
    Ids,
    Vectors,
    column_major,
    cross,
    dot,
    length,
    take_or_all,
    take_rows,
    unit,
)
from illumcli.errors import LimitError
from illumcli.geometry.planar import PlanarPolygons
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry
from illumcli.geometry.transforms import cofactors
from illumcli.rays.camera import Rays
from illumcli.rays.compiled_samples import sample_loop
from illumcli.rays.corner_weights import Corners, CornerWeights, MeanCorners, TriangleCorners
from illumcli.rays.embree import Tracer
from illumcli.rays.offsets import effective_edge
from illumcli.records import Record
from illumcli.render_space import RenderSpace


class Hits(Record):
    """The M samples of a tile whose rays hit a surface; every surface buffer has a row for each."""

    sample: Ids  # (M,) index of the sample in the tile, ascending
    objects: Ids  # (M,) object number
    triangle: Ids  # (M,) stored triangle
    u: Floats  # (M,) float32 weight of corner 1
    v: Floats  # (M,) float32 weight of corner 2


def hits(tracer: Tracer, geometry: SceneGeometry, rays: Rays) -> Hits:
    """The samples whose rays hit a triangle, and where."""
    closest = tracer.closest(rays.origins, rays.directions, coherent=True)
    sample = np.flatnonzero(closest.triangle >= 0).astype(np.int32)
    triangle, instance, u, v = (
        getattr(closest, name).take(sample) for name in ("triangle", "instance", "u", "v")
    )
    return Hits(sample, geometry.objects_of(triangle, instance), triangle, u, v)


class SurfaceInteraction(Record):
    """Positions of hits, and the planes of the triangles that were hit."""

    position: NDArray[np.float64]  # (M, 3) in radii, on the float32 triangle that Embree has
    ng: Vectors  # (M, 3) float32 unit normal of the triangle, on the eye's side
    edge: Floats  # (M,) float32 longest edge, for slivers more (`offsets.effective_edge`), in radii;
    # of instances at least `Instances.reach`
    back_facing: NDArray[np.bool_]  # (M,) the ray hit the back: normals are flipped


def interaction(geometry: SceneGeometry, rays: Rays, hits: Hits) -> SurfaceInteraction:
    """Surface interactions of the hits of camera rays."""
    towards_eye = -take_or_all(rays.directions, hits.sample)
    return interact(geometry, hits.objects, hits.triangle, hits.u, hits.v, towards_eye)


def interact(
    geometry: SceneGeometry, objects: Ids, triangle: Ids, u: Floats, v: Floats, towards_eye: Vectors
) -> SurfaceInteraction:
    """Surface interactions of hits, computed in float64 from the float32 vertices that Embree has."""
    loop = sample_loop()
    is_single = triangle.dtype == np.int32 and all(each.dtype == F for each in (u, v, towards_eye))
    if loop is not None and is_single and geometry.instances is None:
        return SurfaceInteraction(
            *loop.surface(geometry.vertices, geometry.triangles, (triangle, u, v), towards_eye)
        )

    # The triangles' first vertices and edges.
    v0, e1, e2 = (geometry.corner_positions(objects, triangle, k) for k in range(3))
    e1 -= v0
    e2 -= v0

    # The longest edge in single precision, the normal in double.
    sides = column_major(e1, F), column_major(e2, F), column_major(e2 - e1, F)
    edge = np.sqrt(np.maximum(np.maximum(*(dot(side, side) for side in sides[:2])), dot(sides[2], sides[2])))
    normal = cross(e1, e2)
    area = length(normal)
    back_facing = dot(normal, towards_eye) < 0
    scale = np.where(back_facing, -1.0, 1.0)
    scale /= np.maximum(area, np.finfo(np.float64).tiny)
    normal *= scale[:, None]

    # position = v0 + u e1 + v e2, in place
    position = v0
    position += np.multiply(e1, u[:, None], out=e1)
    position += np.multiply(e2, v[:, None], out=e2)
    offset_edge = geometry.offset_edges(objects, effective_edge(edge, area))
    return SurfaceInteraction(position, column_major(normal, F), offset_edge, back_facing)


class ShadingContext(Record):
    """The surface at M hits: what normals and other corner values are interpolated from."""

    geometry: SceneGeometry
    weights: CornerWeights
    interaction: SurfaceInteraction
    normals: CornerVectors | None = None
    """Shading normals at corners; None where every object is flat."""

    def take(self, index: NDArray[Any]) -> ShadingContext:
        """The context of some of the hits, given by ascending indices."""
        if len(index) == len(self.weights):
            return self
        interaction = SurfaceInteraction(
            *(take_rows(values, index) for values in vars(self.interaction).values())
        )
        return ShadingContext(self.geometry, self.weights.take(index), interaction, self.normals)


def facing(n: Vectors, back_facing: NDArray[np.bool_]) -> Vectors:
    """`n`, flipped where the back was hit."""
    return n * (1 - 2 * back_facing.astype(n.dtype))[:, None]


def corner_rows(geometry: SceneGeometry, triangle: Ids, table: CornerVectors) -> tuple[Ids, Ids, Ids]:
    """Rows of `table` at the three corners of each hit triangle."""
    a, b, c = (table.index.take(geometry.corners[:, k].take(triangle)) for k in range(3))
    return a, b, c


def geometric_normal(
    geometry: SceneGeometry,
    hits: Hits,
    interaction: SurfaceInteraction,
    planar_polygons: PlanarPolygons | None = None,
) -> Vectors:
    """(M, 3) float32 unit normal of each hit's polygon, on the eye's side.

    Newell's normal of a planar polygon, otherwise the triangle's. Secondary rays always use the normal of the
    triangle that they leave.
    """
    row = np.zeros(0, np.int32) if planar_polygons is None else planar_polygons.row.take(hits.triangle)
    planar = np.flatnonzero(row >= 0)
    if planar_polygons is None or not planar.size:
        return interaction.ng
    normal = geometry.unit_normals(
        hits.objects.take(planar), take_rows(planar_polygons.normal, row.take(planar))
    )
    ng = take_rows(interaction.ng, planar)
    out = interaction.ng.copy(order="F")
    out[planar] = facing(normal, dot(normal, ng) < 0)
    return out


def interpolated(context: ShadingContext) -> Vectors:
    """(M, 3) unit normal on the eye's side, interpolated linearly and normalized (Phong 1975).

    Where the interpolated normal vanishes, the triangle's.
    """
    interaction = context.interaction
    if context.normals is None:
        return interaction.ng
    loop, by_triangle = sample_loop(), context.weights.by_triangle
    if loop is not None and by_triangle is not None and context.geometry.instances is None:
        at = by_triangle.triangle, by_triangle.u, by_triangle.v
        surface = interaction.ng, interaction.back_facing
        return loop.normals(context.geometry.corners, context.normals, at, *surface)
    n = unit(context.weights.interpolate_normals(context.geometry, context.normals))
    return or_geometric(facing(n, interaction.back_facing), interaction.ng)


def or_geometric(n: Vectors, ng: Vectors) -> Vectors:
    """`n`, replaced in place by the geometric normal `ng` where `n` vanishes."""
    vanished = np.flatnonzero(~(dot(n, n) > 0.25))
    if vanished.size:
        n[vanished] = ng[vanished]
    return n


def quadratic(context: ShadingContext) -> Vectors:
    """(M, 3) unit normal, quadratic along every edge.

    Along an edge delta from n0 to n1 the normal is (1 - s) n0 + s n1 - s (1 - s) b with
    b = 3 ((n0 + n1).delta / delta.delta) delta, so that on average it is perpendicular to the edge. Linear
    interpolation misses an inflection between two equal normals; this does not. Over a triangle the edge
    terms have the weights w_i w_j of their ends, over a planar polygon of more corners w_i w_j / (w_i + w_j).
    Both reduce to the formula above on an edge; the second is linear between two parallel edges of a quad.

    References
    ----------
    van Overveld, C. W. A. M. and Wyvill, B. (1997). Phong normal interpolation revisited. ACM TOG 16(4).
    """
    geometry, weights, interaction = context.geometry, context.weights, context.interaction
    normals = context.normals
    if normals is None:
        return interaction.ng
    n = column_major(weights.interpolate_normals(geometry, normals))
    for group in weights.groups:

        def corner(k: int, group: Corners = group) -> Corner:
            return group.position(geometry, k), group.normal(geometry, normals, k), group.end_weight(k)

        share = np.multiply if isinstance(group, TriangleCorners) else between
        if group.index is None:
            subtract_edge_terms(n, group.count, corner, share)
        else:
            part = take_rows(n, group.index)
            subtract_edge_terms(part, group.count, corner, share)
            n[group.index] = part
    return or_geometric(facing(unit(n), interaction.back_facing), interaction.ng)


Corner: TypeAlias = tuple[Vectors, Vectors, Floats]
"""(M, 3) position of a corner, (M, 3) its unit normal, (M,) its weight."""


def between(first: Floats, last: Floats) -> Floats:
    """(M,) w_i w_j / (w_i + w_j) for the weights of an edge's ends; 0 where one is not positive."""
    product = np.maximum(first, 0) * np.maximum(last, 0)
    return np.divide(product, first + last, out=np.zeros_like(product), where=product > 0)


def subtract_edge_terms(
    n: Vectors,
    count: int,
    corner: Callable[[int], Corner],
    share: Callable[[Floats, Floats], Floats] = np.multiply,
) -> None:
    """Subtract the quadratic terms of a polygon's edges from its linear normals `n`, (M, 3), in place.

    Parameters
    ----------
    n : (M, 3)
        Linearly interpolated, not normalized.
    share
        The weight of an edge's term, from the weights of its ends.
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
    """(M, 2) texture coordinates of hits, linear on every triangle; 0 where a mesh has none."""
    return _with_all(geometry, uvs, TriangleCorners(None, hits.objects, hits.triangle, hits.u, hits.v))


def uv_at(geometry: SceneGeometry, uvs: CornerVectors, weights: CornerWeights) -> NDArray[np.float32]:
    """(M, 2) texture coordinates of shading points; 0 where a mesh has none.

    Linear on every triangle, as exporters and bakers assume; a polygon's point has the mean of its corners.
    """
    out = _with_all(geometry, uvs, weights.hits)
    for group in weights.groups:
        if isinstance(group, MeanCorners):
            index = slice(None) if group.index is None else group.index
            out[index] = _with_all(geometry, uvs, group)
    return out


def _with_all(geometry: SceneGeometry, uvs: CornerVectors, corners: Corners) -> NDArray[np.float32]:
    """(m, 2) weighted means of the corners' uv; 0 where a corner has none."""
    index = [uvs.index.take(corners.corner(geometry, k)) for k in range(corners.count)]
    has = np.minimum.reduce(index) >= 0
    if not has.any():
        return np.zeros((len(has), 2), F, order="F")
    mean = corners.mean(lambda k: take_rows(uvs.values, index[k]))
    return np.asarray(np.where(has[:, None], mean, F(0)))


def uv_tangents(geometry: SceneGeometry, uvs: CornerVectors) -> CornerVectors:
    """Unit tangent at every stored corner, in the direction of increasing u, in its mesh's space.

    The mean, weighted by angle, over the adjacent triangles with the same vertex, uv and handedness of their
    uv, so that the grain of a smooth surface is smooth up to its uv seams. Zero where there are no uv, or
    degenerate ones.
    """
    # The tangent of every triangle, and its handedness.
    points = [take_rows(geometry.vertices, corner).astype(np.float64) for corner in geometry.triangles.T]
    at = corner_rows(geometry, np.arange(len(geometry.triangles), dtype=np.int32), uvs)
    along, hand = _along_u(points, at, uvs)

    # Sum those of corners with the same vertex, uv and handedness, weighted by the triangle's angle there.
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

    # Corners that are in no triangle have none.
    none = np.zeros((1, 3))
    corner = np.full(len(uvs.index), len(sums), np.int32)
    corner[geometry.corners.ravel()] = index.ravel()
    return CornerVectors(column_major(np.concatenate([unit(sums), none]), F), corner)


def _along_u(
    points: Sequence[Vectors], at: Sequence[Ids], uvs: CornerVectors
) -> tuple[Vectors, NDArray[np.int64]]:
    """(T, 3) unit tangents in the direction of increasing u, and (T,) the handedness of each triangle's uv.

    The handedness is 0 for mirrored uv, 1 for degenerate ones or none, 2 otherwise.
    """
    if not len(uvs.values):
        return np.zeros_like(points[0]), np.ones(len(points[0]), np.int64)
    t0, t1, t2 = (take_rows(uvs.values, np.maximum(index, 0)).astype(np.float64) for index in at)
    a, b = t1 - t0, t2 - t0
    has = (at[0] >= 0) & (at[1] >= 0) & (at[2] >= 0)
    hand = np.where(has, np.sign(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), 0)
    e1, e2 = points[1] - points[0], points[2] - points[0]
    along: Vectors = b[:, 1][:, None] * e1 - a[:, 1][:, None] * e2
    return unit(along) * hand[:, None], hand.astype(np.int64) + 1


def world_position(render_space: RenderSpace, interaction: SurfaceInteraction) -> Vectors:
    """(M, 3) float32 position [scene units]."""
    return column_major(render_space.to_world(interaction.position), F)


def object_id(hits: Hits) -> NDArray[np.uint32]:
    """(M,) number of the object, from 1."""
    return (hits.objects + 1).astype(np.uint32)


def triangle_id(geometry: SceneGeometry, hits: Hits) -> NDArray[np.uint32]:
    """(M,) number of the triangle among those of all objects, from 1.

    Raises
    ------
    LimitError
        There are more triangles than numbers.
    """
    if geometry.triangle_count >= 2**32:
        raise LimitError(
            f"triangle_id: numbers end at 2^32, the objects have {geometry.triangle_count:.3g} triangles; "
            "leave the layer out or objects away"
        )
    return (geometry.triangle_numbers(hits.objects, hits.triangle) + 1).astype(np.uint32)


def rings(
    matrix: NDArray[np.float64], axis: Sequence[float], centre: ArrayLike, position: Vectors
) -> Vectors:
    """(M, 3) unit tangent of the circle about an axis through each point; zero on the axis.

    Parameters
    ----------
    matrix : (3, 3)
        From object space, in which the axis and the circles are defined, to the space of `position`. A
        non-uniform scale turns circles into ellipses.
    centre : (3,)
        A point on the axis, in the space of `position`.
    """
    local = (position - np.asarray(centre)) @ cofactors(matrix)  # the inverse, times the determinant
    ring = np.cross(axis, local) @ matrix.T
    return unit(ring * np.sign(np.linalg.det(matrix)))


def tangent(n: Vectors, grain: Vectors) -> Vectors:
    """(M, 3) `grain` projected perpendicular to `n`, unit; any perpendicular where it is parallel or zero."""
    t = grain - dot(grain, n)[:, None] * n
    size = length(t)
    undefined = np.flatnonzero(~(size > 1e-4))
    if undefined.size:
        m = n[undefined]
        axis = np.zeros_like(m)
        axis[np.arange(len(m)), np.argmin(np.abs(m), axis=1)] = 1
        t[undefined] = axis - dot(axis, m)[:, None] * m
    return unit(t)
