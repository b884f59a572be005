"""Ray offsets: secondary rays start above the triangle they leave, by little more than the rounding error."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors, column_major, dot, length
from illumcli.rays.compiled_samples import sample_loop

ORIGIN_OFFSET = 4 * 2.0**-24
"""Offset of a ray's origin, relative to position and edge: four times the smallest without self-intersection.
Objects 1e-6 radii apart still shadow each other."""

ULP = 2.0**-23
LONGEST = 100.0
"""Upper bound on a sliver's effective edge [radii]: the offset stays below 2.4e-5 radii."""


def effective_edge(edge: Floats, area: NDArray[np.floating]) -> Floats:
    """(N,) float32 length that a hit's rounding error is proportional to: the longest edge, for slivers more.

    Embree computes a triangle's normal in single precision from edges that in a sliver are nearly parallel,
    so the relative error of its plane grows with edge / height. Measured on needles of aspect 100 to 10,000,
    rotated off the axes: with the longest edge alone up to 8 % of the rays hit their own triangle, with a
    quarter of edge^2 / height none at 1000 and 200 ppm at 10,000.

    Parameters
    ----------
    edge : (N,)
        The longest edge.
    area : (N,)
        Twice the triangle's area.
    """
    aspect = edge * edge / np.maximum(4 * area, np.finfo(F).tiny)
    return np.minimum(edge * np.maximum(aspect, 1), np.maximum(edge, LONGEST)).astype(F)


def offset_ray_origins(position: NDArray[np.float64], ng: Vectors, edge: Floats) -> Vectors:
    """(N, 3) float32 origins above the triangle: position + 4 2^-24 (|ng|.|position| + edge) ng, and one ulp.

    Parameters
    ----------
    position : (N, 3) float64
        On the triangle, in radii from the scene's centre.
    ng : (N, 3)
        Unit normal of the triangle, on the side that the ray leaves.
    edge : (N,)
        The triangle's longest edge, or its `effective_edge`.
    """
    loop = sample_loop()
    is_single = ng.dtype == edge.dtype == F and position.dtype == np.float64
    is_by_component = position.flags.f_contiguous and ng.flags.f_contiguous
    if loop is not None and is_single and is_by_component and position.shape == ng.shape == (*edge.shape, 3):
        return loop.ray_origins(position, ng, np.ascontiguousarray(edge))
    size = np.abs(position)
    step = (ORIGIN_OFFSET * (dot(np.abs(ng), size) + edge))[:, None] * ng
    # twice the rounding to float32, outwards, so that rounding never moves a component back inwards
    size *= ULP
    step += np.copysign(size, ng, out=size)
    step += position
    return column_major(step, F)


def to_tangent_plane(position: Vectors, corner: Vectors, normal: Vectors) -> Vectors:
    """(N, 3) vector from each position up to the plane through `corner` with unit `normal`; 0 above it.

    The mean of these vectors, weighted by a polygon's interpolation weights, leads to the smooth surface that
    the normals at its corners imply.

    References
    ----------
    Hanika, J. (2021). Hacking the shadow terminator. Ray Tracing Gems II, chapter 4.
    """
    below = np.minimum(dot(position - corner, normal), 0)
    return -below[:, None] * normal


def bounded(offset: Vectors, max_length: Floats) -> Vectors:
    """(N, 3) `offset`, shortened to `max_length` where it is longer."""
    size = length(offset)
    return offset * np.divide(max_length, size, out=np.ones_like(size), where=size > max_length)[:, None]
