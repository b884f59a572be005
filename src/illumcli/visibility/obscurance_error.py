"""Standard errors of obscurance, predicted from each point's own rays.

A low-discrepancy point set has less error than independent rays, but its own samples do not tell how much
less: sqrt(p (1 - p) / N) is several times too large. `Errors` is fitted to pairs of independent estimates at
a few points. It predicts the error from the variation of mu between neighbouring rays, and so gives every
point its own standard error without splitting its rays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors
from illumcli.records import Record, Value

NO_HIT_QUANTILE = 3 / 1.96
"""Rule of three, as a standard error: if none of K rays was blocked, the probability of a blocked ray is at
most 3 / K with 95 % confidence."""


class Estimates(Record):
    """Estimates of w at M points, with what predicts their errors."""

    w: NDArray[np.float32]  # (M,) in [0, 1]
    neighbor_variation: NDArray[np.float32]  # (M,) sum of squared differences of mu between neighbouring rays
    bent: Vectors | None = None  # (M, 3) float32 bent normal: unit mean unoccluded direction
    skipped: int = 0  # points known to be open, which cast no rays


class Errors(Value):
    """The error model of a bake: standard error of w = sqrt(floor + slope * neighbor_variation) / samples.

    It is fitted to pairs of independent scrambles: half the squared difference of two estimates is an
    unbiased estimate of their variance.
    """

    floor: float  # variance, times samples^2, of points whose rays all have the same mu
    slope: float
    rmse: float  # root of the mean variance over the points of the pairs
    pairs: int  # points with two estimates

    @classmethod
    def of_pairs(cls, a: Estimates, b: Estimates, samples: NDArray[np.integer[Any]] | int) -> Errors:
        """The model fitted to K pairs of estimates, (K,) each, from independent scrambles."""
        if not len(a.w):
            return cls(0.0, 0.0, 0.0, 0)

        # Regress the variance on the variation, weighted: the error of a variance is proportional to it.
        variance = np.square(a.w.astype(np.float64) - b.w) / 2
        scaled = np.tile(variance * np.square(samples, dtype=np.float64), 2)
        x = np.concatenate([a.neighbor_variation, b.neighbor_variation]).astype(np.float64)
        floor, slope = line(x, scaled, 1 / np.square(1 + x))

        # If no ray of any pair was blocked, the floor is still not known to be lower than this.
        least = (NO_HIT_QUANTILE / (2 * len(a.w))) ** 2
        return cls(max(floor, least), slope, float(np.sqrt(variance.mean())), len(a.w))

    def at(self, neighbor_variation: Floats, samples: NDArray[np.integer[Any]] | int) -> NDArray[np.float32]:
        """(M,) float32 standard error of each estimate."""
        scaled = self.floor + self.slope * neighbor_variation.astype(np.float64)
        return (np.sqrt(scaled) / samples).astype(F)


def line(x: Floats, y: Floats, weight: Floats) -> tuple[float, float]:
    """a and b of the weighted least-squares line y = a + b x, both at least 0."""
    s, sx, sy, sxx, sxy = (float(np.sum(weight * v)) for v in (np.ones_like(x), x, y, x * x, x * y))
    determinant = s * sxx - sx * sx
    slope = (s * sxy - sx * sy) / determinant if determinant > 1e-12 * s * sxx else 0.0
    start = (sy - slope * sx) / s
    if slope < 0:
        return sy / s, 0.0
    if start < 0:
        return 0.0, sxy / sxx
    return start, slope
