"""Directions in the tangent spaces of a surface, in which normal maps are."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import cross, dot, unit

Rows = NDArray[np.floating[Any]]


def to_tangent(direction: Rows, normal: Rows, tangent: Rows, sign: NDArray[Any]) -> Rows:
    """(N, 3) components of directions along tangent, bitangent and normal, as glTF and OpenGL have them: x
    towards +u, y up, towards the top of the picture, and z out of the surface.

    The frame is orthonormal: the tangent is made perpendicular to the normal, the bitangent is
    sign * normal x tangent (glTF 2.0, 3.7.2.1).

    Parameters
    ----------
    direction, normal : (N, 3)
        Unit vectors.
    tangent : (N, 3)
        The direction in which u grows.
    sign : (N,)
        1, or -1 where the uv are mirrored.
    """
    along = unit(tangent - dot(tangent, normal)[:, None] * normal)
    across = sign[:, None] * cross(normal, along)
    return np.stack([dot(direction, axis) for axis in (along, across, normal)], axis=1)
