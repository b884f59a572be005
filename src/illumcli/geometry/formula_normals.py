"""Normals of surfaces that formulas describe, from their exact derivatives."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Vectors, cross
from illumcli.formula import Formula


def implicit_normal(f: Formula, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) gradient of f(x, y, z) at (N, 3) points, not normalised; towards growing f."""
    return np.stack(f.gradient(*points.T)[1], axis=1)


def parametric_normal(
    x: Formula, y: Formula, z: Formula, u: NDArray[np.float64], v: NDArray[np.float64]
) -> Vectors:
    """(N, 3) d/du x d/dv of the surface (x, y, z)(u, v) at (N,) u and v, not normalised."""
    slopes = np.array([f.gradient(u, v)[1] for f in (x, y, z)])  # (3, 2, N)
    return cross(slopes[:, 0].T, slopes[:, 1].T)
