"""Where a secondary ray starts: off its own surface by the rounding of the arithmetic, and no more."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Lanes, Vectors, columns, dot, length

SHARE = 4 * 2.0**-24
"""Four times the distance at which false self-hits begin; contact gaps of 1e-6 radii still shade."""

ULP = 2.0**-23
TERMINATOR_SHARE = 1 / 3
"""Of a polygon's diameter: how far off it a shadow ray may start at most. On a sphere a terminator offset of
0.24 (a cube's faces) to 0.27 (an octahedron's) is wanted, on finer ones less."""
LONGEST = 100.0
"""No sliver counts as longer than this [radii]: its rays start 2.4e-5 radii off at most."""


def effective_edge(edge: Lanes, area: NDArray[np.floating]) -> Lanes:
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


def lifted(position: NDArray[np.float64], ng: Vectors, edge: Lanes) -> Vectors:
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
    step = (SHARE * (dot(np.abs(ng), size) + edge))[:, None] * ng
    # twice the rounding to float32 outwards, so that rounding never brings a component back inwards
    size *= ULP
    step += np.copysign(size, ng, out=size)
    step += position
    return columns(step, F)


def terminator_offset(
    position: Vectors,
    corners: Sequence[Vectors],
    normals: Sequence[Vectors],
    weights: Sequence[Lanes],
) -> Vectors:
    """(N, 3) the way from `position` to the mean of its projections on the corners' tangent planes.

    A smooth-shaded mesh lights points that its flat facets shade; a shadow ray that starts there leaves
    the curved surface the normals imply. Where the surface is hollow the way is 0, and it is never longer
    than `TERMINATOR_SHARE` of the longest distance between two corners.

    References
    ----------
    Hanika, J. (2021). Hacking the shadow terminator. Ray Tracing Gems II, chapter 4. The bound is ours:
    normals may say anything.
    """
    way = np.zeros_like(position)
    for corner, normal, weight in zip(corners, normals, weights, strict=True):
        below = np.minimum(dot(position - corner, normal), 0)
        way -= (weight * below)[:, None] * normal
    height, most = length(way), TERMINATOR_SHARE * diameter(corners)
    return way * np.divide(most, height, out=np.ones_like(height), where=height > most)[:, None]


def diameter(corners: Sequence[Vectors]) -> Lanes:
    """(N,) the longest distance between two corners of each polygon, given corner by corner."""
    squares = [dot(side, side) for a, b in combinations(corners, 2) for side in (np.subtract(a, b),)]
    return np.sqrt(np.maximum.reduce(squares))
