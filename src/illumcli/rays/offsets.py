"""Where a secondary ray starts: off its own surface by the rounding of the arithmetic, and no more."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Lanes, Vectors, columns, dot

SHARE = 4 * 2.0**-24
"""Four times the distance at which false self-hits begin; contact gaps of 1e-6 radii still shade."""


def lifted(position: NDArray[np.float64], ng: Vectors, edge: Lanes) -> Vectors:
    """(N, 3) float32 origins above the facet: position + 4 2^-24 (|ng|.|position| + edge) ng, and one ulp.

    Parameters
    ----------
    position : (N, 3) float64
        On the facet, in radii from the scene's centre.
    ng : (N, 3)
        Unit facet normal on the side the ray leaves.
    edge : (N,)
        The facet's longest edge.
    """
    step = (SHARE * (dot(np.abs(ng), np.abs(position)) + edge))[:, None] * ng
    origin = columns(position + step, F)
    outward = np.copysign(F(np.inf), step).astype(F)
    return np.where(step != 0, np.nextafter(origin, outward), origin)


def over_tangent_planes(
    position: NDArray[np.float64],
    corners: tuple[Vectors, Vectors, Vectors],
    normals: tuple[Vectors, Vectors, Vectors],
    weights: tuple[Lanes, Lanes, Lanes],
) -> NDArray[np.float64]:
    """(N, 3) `position` moved to the mean of its projections on the corners' tangent planes.

    A smooth-shaded mesh lights points that its flat facets shade; a shadow ray that starts from here leaves
    the curved surface the normals pretend. Where the surface is hollow the point stays.

    References
    ----------
    Hanika, J. (2021). Hacking the shadow terminator. Ray Tracing Gems II, chapter 4.
    """
    moved = position.copy(order="F")
    for corner, normal, weight in zip(corners, normals, weights, strict=True):
        below = np.minimum(dot(position - corner, normal), 0)
        moved -= (weight * below)[:, None] * normal
    return moved
