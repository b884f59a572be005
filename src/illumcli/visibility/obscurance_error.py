"""Standard errors of obscurance, predicted from each point's own rays.

A low-discrepancy point set has less error than independent rays, but cannot reveal how much less:
sqrt(p (1 - p) / N) is several times too wide. `Errors` is fitted to pairs of independent estimates at a few
points; it relates the error to how much mu varies between neighbouring rays, and so gives every point a
standard error of its own without splitting its rays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors
from illumcli.records import Record, Value

NO_HIT_QUANTILE = 3 / 1.96
"""Rule of three: where none of K rays was blocked, at most 3 / K are, with 95 % confidence; as a standard
error."""


class Estimates(Record):
    """w at M points, and what was learned beside it."""

    w: NDArray[np.float32]  # (M,) in [0, 1]
    neighbor_variation: NDArray[np.float32]  # (M,) sum of squared differences of mu between neighbouring rays
    bent: Vectors | None = None  # (M, 3) float32 bent normal: unit mean open direction; 0 where nothing is
    skipped: int = 0  # points known to be open, which cast no rays


class Errors(Value):
    """The error model of a bake: standard error of w = sqrt(floor + slope * neighbor_variation) / samples.

    It is fitted to pairs of independent scrambles: half the squared difference of two estimates is an
    unbiased estimate of their variance.
    """

    floor: float  # variance, times samples^2, of points whose rays all agree
    slope: float
    rmse: float  # root of the mean variance over the points that the pairs were drawn from
    pairs: int

    @classmethod
    def of_pairs(cls, a: Estimates, b: Estimates, samples: NDArray[np.integer[Any]] | int) -> Errors:
        """The model that fits K pairs of estimates, (K,) each, from independent scrambles."""
        if not len(a.w):
            return cls(0.0, 0.0, 0.0, 0)

        # Regress the variance on the variation; a variance is known in proportion to itself.
        variance = np.square(a.w.astype(np.float64) - b.w) / 2
        scaled = np.tile(variance * np.square(samples, dtype=np.float64), 2)
        x = np.concatenate([a.neighbor_variation, b.neighbor_variation]).astype(np.float64)
        floor, slope = _line(x, scaled, 1 / np.square(1 + x))

        # Where no ray of any pair met anything, that bounds the floor no further than this.
        least = (NO_HIT_QUANTILE / (2 * len(a.w))) ** 2
        return cls(max(floor, least), slope, float(np.sqrt(variance.mean())), len(a.w))

    def at(self, neighbor_variation: Floats, samples: NDArray[np.integer[Any]] | int) -> NDArray[np.float32]:
        """(M,) float32 standard error of each estimate."""
        scaled = self.floor + self.slope * neighbor_variation.astype(np.float64)
        return (np.sqrt(scaled) / samples).astype(F)


def _line(x: Floats, y: Floats, weight: Floats) -> tuple[float, float]:
    """a and b of the weighted least-squares line y = a + b x with neither below 0."""
    s, sx, sy, sxx, sxy = (float(np.sum(weight * v)) for v in (np.ones_like(x), x, y, x * x, x * y))
    determinant = s * sxx - sx * sx
    slope = (s * sxy - sx * sy) / determinant if determinant > 1e-12 * s * sxx else 0.0
    start = (sy - slope * sx) / s
    if slope < 0:
        return sy / s, 0.0
    if start < 0:
        return 0.0, sxy / sxx
    return start, slope
