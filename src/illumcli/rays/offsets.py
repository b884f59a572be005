"""Ray offsets: secondary rays start off their own surface by the rounding error of the arithmetic alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors, column_major, dot, length

ORIGIN_OFFSET = 4 * 2.0**-24
"""Offset of a ray's origin, relative to position and edge: four times the smallest one without self-hits.
Objects 1e-6 radii apart still shadow each other."""

ULP = 2.0**-23
LONGEST = 100.0
"""No sliver counts as longer than this [radii]: its rays start 2.4e-5 radii off at most."""


def effective_edge(edge: Floats, area: NDArray[np.floating]) -> Floats:
    """(N,) float32 the length that the rounding of a hit goes with: the longest edge, for slivers more.

    The ray core forms a triangle's normal in single precision from edges that in a sliver are nearly
    parallel, so its plane errs by a share that grows with edge / height. Measured on needles of aspect 100
    to 10,000 that are turned out of their axes: with the longest edge alone up to 8 % of the rays hit their
    own triangle, with a quarter of edge^2 / height none at 1000 and 200 ppm at 10,000.

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
    """(N, 3) float32 origins above the facet: position + 4 2^-24 (|ng|.|position| + edge) ng, and one ulp.

    Parameters
    ----------
    position : (N, 3) float64
        On the facet, in radii from the scene's centre.
    ng : (N, 3)
        Unit facet normal on the side the ray leaves.
    edge : (N,)
        The facet's longest edge, or its `effective_edge`.
    """
    size = np.abs(position)
    step = (ORIGIN_OFFSET * (dot(np.abs(ng), size) + edge))[:, None] * ng
    # twice the rounding to float32 outwards, so that rounding never brings a component back inwards
    size *= ULP
    step += np.copysign(size, ng, out=size)
    step += position
    return column_major(step, F)


def to_tangent_plane(position: Vectors, corner: Vectors, normal: Vectors) -> Vectors:
    """(N, 3) the way from each position up to the plane through `corner` with unit `normal`; 0 from above it.

    The mean of these ways, by the weights of a polygon's corners, leads to the curved surface that the
    corners' normals imply.

    References
    ----------
    Hanika, J. (2021). Hacking the shadow terminator. Ray Tracing Gems II, chapter 4.
    """
    below = np.minimum(dot(position - corner, normal), 0)
    return -below[:, None] * normal


def bounded(way: Vectors, most: Floats) -> Vectors:
    """(N, 3) `way`, no longer than `most`."""
    size = length(way)
    return way * np.divide(most, size, out=np.ones_like(size), where=size > most)[:, None]
