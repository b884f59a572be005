"""Directional albedo: the share of light from one direction that leaves the surface again."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from illumcli.arrays import column_major
from illumcli.brdf.views import Look, seen_from

Doubles = NDArray[np.float64]

ANGLES = (*np.arange(0.0, 88.0, 3.0).tolist(), 89.0)
"""Angles of incidence of a curve [degrees]."""
TOLERANCE = 1e-3
"""Accepted difference between a quadrature and one of a quarter of its directions, relative to the albedo."""
FEWEST, MOST = 48, 192
"""Directions along a meridian; twice as many around."""


class AlbedoCurve(NamedTuple):
    """Albedo against the angle of incidence."""

    angles: Doubles
    """(K,) [degrees]"""
    values: Doubles
    """(K, 3)"""
    error: float
    """The largest relative difference that is left; at most TOLERANCE unless the quadrature ended before."""


def albedo_curve(model: Look) -> AlbedoCurve:
    """The albedo of a model over the angle of incidence, in the plane of its grain."""
    found = [albedo(model, angle) for angle in ANGLES]
    return AlbedoCurve(
        np.array(ANGLES), np.array([values for values, _ in found]), max(error for _, error in found)
    )


def albedo(model: Look, incidence: float) -> tuple[Doubles, float]:
    """(3,) the integral of f_r cos(theta_v) over all directions, and its relative error.

    The number of directions is multiplied by four until the integral no longer changes.

    Parameters
    ----------
    incidence : float
        Angle of the light to the normal [degrees].
    """
    steps = FEWEST
    values, error = _quadrature(model, incidence, steps), np.inf
    while error > TOLERANCE and steps < MOST:
        steps *= 2
        finer = _quadrature(model, incidence, steps)
        error = float(np.abs(finer - values).max() / max(finer.max(), np.finfo(float).tiny))
        values = finer
    return values, error


def _quadrature(model: Look, incidence: float, steps: int) -> Doubles:
    """(3,) the integral over `steps` times `2 steps` directions, in polar coordinates about the mirror
    direction.

    Along a meridian, the root of the angle has the nodes of Gauss and Legendre: a narrow highlight has as
    many as a wide one. The meridian ends at the horizon.
    """
    # Angles from the mirror direction, and the solid angle of each node.
    angle = np.radians(incidence)
    node, weight = leggauss(steps)
    root = ((1 + node) / 2)[:, None]
    around = (np.arange(2 * steps) + 0.5) / (2 * steps) * 2 * np.pi
    horizon = np.arctan2(np.cos(angle), np.cos(around) * np.sin(angle))
    away = root**2 * horizon
    solid = (weight / 2)[:, None] * 2 * root * horizon * np.sin(away) * (np.pi / steps)

    # Rotate the axis from the mirror direction to the normal.
    x, y, z = np.sin(away) * np.cos(around), np.sin(away) * np.sin(around), np.cos(away)
    v = np.stack([x * np.cos(angle) + z * np.sin(angle), y, z * np.cos(angle) - x * np.sin(angle)], axis=-1)
    v = column_major(v.reshape(-1, 3))
    weights = solid.ravel() * np.maximum(v[:, 2], 0)
    f = seen_from(model, incidence, v, times_cos=False)
    return np.array([np.sum(weights * f[:, c]) for c in range(3)])  # the last bits of BLAS vary
