"""Border texels across seams: where the surface goes on smoothly beyond the edge of a chart, so do they.

The centre of a border texel lies beyond an edge of its chart. If it took its value at the edge, lookups on
both sides of the seam would differ by what w changes within a texel. Instead its place is found by unfolding
the neighbouring triangle into the plane of the chart's. At hard edges and borders of the surface it is the
nearest place of the chart.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Ids, Vectors, cross, dot, length, take_rows, unit
from illumcli.atlas.borders import BorderTexels
from illumcli.atlas.triangles import AtlasTriangles
from illumcli.baking.points import Surfaces
from illumcli.geometry.scene_geometry import triangle_normals
from illumcli.records import Record

SMOOTH = 0.9
"""Least cosine between the shading normals of two triangles at both ends of an edge that is no hard one."""
INSIDE = 2.0**-8
"""Least weight of a corner: places are inside their triangles."""


class Places(Record):
    """K places on stored triangles."""

    triangle: Ids  # (K,)
    u: NDArray[np.float32]  # (K,) weight of corner 1
    v: NDArray[np.float32]  # (K,) weight of corner 2


class Neighbours(Record):
    """The triangle across every edge of a mesh, from corner k to the next, and its corner off the edge."""

    triangle: NDArray[np.int32]  # (T, 3) -1 where there is none, or several
    opposite: NDArray[np.int8]  # (T, 3) that corner


def neighbours(vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> Neighbours:
    """The triangles across edges that two triangles share in opposite directions; vertices at one place count
    as one."""
    _, place = np.unique(np.ascontiguousarray(vertices), axis=0, return_inverse=True)
    at = place.ravel()[triangles].astype(np.int64)
    first, second = at.T.ravel(), np.roll(at, -1, axis=1).T.ravel()
    low, high = np.minimum(first, second), np.maximum(first, second)
    order = np.lexsort((high, low))
    new = (np.diff(low[order], prepend=-1) != 0) | (np.diff(high[order], prepend=-1) != 0)
    begins = np.flatnonzero(new)
    pairs = begins[np.diff(np.append(begins, len(order))) == 2]
    a, b = order[pairs], order[pairs + 1]
    opposed = (first[a] == second[b]) & (first[a] != second[a])
    a, b = a[opposed], b[opposed]

    # edge k of triangle t has number k T + t
    count = len(triangles)
    out, opposite = np.full(3 * count, -1, np.int32), np.zeros(3 * count, np.int8)
    for this, other in ((a, b), (b, a)):
        out[this], opposite[this] = other % count, (other // count + 2) % 3
    return Neighbours(out.reshape(3, -1).T, opposite.reshape(3, -1).T)


def across_seams(surfaces: Surfaces, triangles: AtlasTriangles, border: BorderTexels, near: Places) -> Places:
    """The places of border texels, beyond the seam where the surface is smooth there, else as `near`."""
    geometry = surfaces.geometry
    own = np.unique(geometry.objects[near.triangle])
    if not own.size:
        return near
    of_object = np.flatnonzero(geometry.objects == own[0])
    first = int(of_object[0])
    across = neighbours(geometry.vertices, geometry.triangles[of_object])

    # texels with a triangle across their edge that has an area, and its corner off the edge
    edge = border.edge.astype(np.int64)
    beyond = across.triangle[near.triangle - first, edge]
    opposite = across.opposite[near.triangle - first, edge].astype(np.int64)
    index = np.flatnonzero(beyond >= 0)
    area = length(triangle_normals(geometry)[beyond[index] + np.int32(first)])
    index = index[area > 0]
    index = index[
        _is_smooth(surfaces, near.triangle[index], edge[index], beyond[index] + first, opposite[index])
    ]
    here, there = near.triangle[index], beyond[index] + np.int32(first)
    start, end, third = edge[index], (edge[index] + 1) % 3, opposite[index]

    # where the centre lies: along the edge, and beyond it by a height of the triangle
    number = border.number[index].astype(np.int64)
    weights = np.stack([np.zeros(len(index)), *triangles.weights(number, border.x[index], border.y[index])])
    weights[0] = 1 - weights[1] - weights[2]
    every = np.arange(len(index))
    inner = (start + 2) % 3
    a, b, c = (_corners(surfaces, here, k) for k in (start, end, inner))
    d = _corners(surfaces, there, third)
    square = np.maximum(dot(b - a, b - a), 1e-30)
    out = -weights[inner, every] * length(cross(b - a, c - a))
    along = weights[end, every] + weights[inner, every] * dot(c - a, b - a) / square

    # the same place of the neighbour, whose edge runs the other way
    share = out / np.maximum(length(cross(b - a, d - a)), 1e-30)
    at_end = along - share * dot(d - a, b - a) / square
    new = np.zeros((3, len(index)))
    new[third, every] = share
    new[(third + 2) % 3, every] = 1 - at_end - share
    new[(third + 1) % 3, every] = at_end
    new = np.clip(new, INSIDE, None)
    new /= new.sum(axis=0)
    triangle, u, v = near.triangle.copy(), near.u.copy(), near.v.copy()
    triangle[index], u[index], v[index] = there, new[1].astype(F), new[2].astype(F)
    return Places(triangle, u, v)


def _is_smooth(
    surfaces: Surfaces, here: Ids, edge: NDArray[np.int64], there: Ids, opposite: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """(K,) True where two triangles have nearly equal shading normals at both ends of their edge."""
    ends = ((edge, (opposite + 2) % 3), ((edge + 1) % 3, (opposite + 1) % 3))
    cosines = [
        dot(_normals(surfaces, here, mine), _normals(surfaces, there, others)) for mine, others in ends
    ]
    return np.asarray(np.minimum(*cosines) >= SMOOTH)


def _corners(surfaces: Surfaces, triangle: Ids, k: NDArray[np.int64]) -> Vectors:
    """(K, 3) float64 positions of corner k of triangles."""
    geometry = surfaces.geometry
    return np.asarray(take_rows(geometry.vertices, geometry.triangles[triangle, k]), np.float64)


def _normals(surfaces: Surfaces, triangle: Ids, k: NDArray[np.int64]) -> Vectors:
    """(K, 3) unit shading normals at corner k of triangles."""
    normals = surfaces.normals
    return unit(take_rows(normals.values, normals.index[surfaces.geometry.corners[triangle, k]]))
