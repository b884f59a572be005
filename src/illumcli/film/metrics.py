"""Differences between two images: sums over all pixels and channels, in float64."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.records import Value

RELATIVE_FLOOR = 0.01
"""Added to the reference's square in `relative_mse`, so that it is finite at black pixels."""

_BAND = 1 << 20  # values in float64 at once


class Difference(Value):
    """The result of `difference`: d = other - reference, r = reference, means over values finite in both.

    Equal values differ by 0, infinite ones too. A value that is NaN in either image, or infinite in one,
    counts only in `not_finite`; if no other value is left, the means are NaN.
    """

    count: int
    """Number of values compared."""
    not_finite: int
    mae: float
    """mean |d|"""
    mse: float
    """mean d^2"""
    relative_mse: float
    """mean d^2 / (r^2 + 0.01)"""
    largest: float
    """max |d|"""
    place: tuple[int, int, int]
    """Row, column and channel of the largest, the first of equals."""
    peak: float
    """The value that `psnr` is relative to."""

    @property
    def rmse(self) -> float:
        """sqrt(mean d^2)"""
        return math.sqrt(self.mse)

    @property
    def psnr(self) -> float:
        """10 log10(peak^2 / mse) [dB]; infinite for equal images."""
        if self.mse == 0:
            return math.inf
        return 10 * math.log10(self.peak**2 / self.mse) if self.peak > 0 else -math.inf


def difference(reference: NDArray[Any], other: NDArray[Any], peak: float | None = 1.0) -> Difference:
    """All measures between two images of one shape, in one pass over bands of rows.

    Parameters
    ----------
    reference, other : (H, W) or (H, W, C)
    peak : float, optional
        Peak of the signal, for `psnr`: 1 for display values. None: the largest finite |r|.
    """
    if reference.shape != other.shape:
        raise ValueError(f"images of different shape: {reference.shape} and {other.shape}")
    shape = (*reference.shape, 1)[:3]
    reference, other = reference.reshape(shape), other.reshape(shape)
    height, width, channels = shape

    # By bands of rows: float64 copies of the images might not fit into memory.
    rows = max(1, _BAND // max(1, width * channels))
    count = not_finite = 0
    absolute = square = relative = top = 0.0
    largest, place = 0.0, (0, 0, 0)
    for y in range(0, height, rows):
        r = reference[y : y + rows].astype(np.float64)
        d = absolute_difference(r, other[y : y + rows])
        # Values that are not finite are counted, and contribute 0 to the sums.
        use = np.isfinite(d)
        used = int(np.count_nonzero(use))
        not_finite += use.size - used
        d = np.where(use, d, 0)
        r = np.where(np.isfinite(r), r, 0)
        count += used
        absolute += float(d.sum())
        square += float(np.square(d).sum())
        relative += float((np.square(d) / (np.square(r) + RELATIVE_FLOOR)).sum())
        top = max(top, float(np.abs(r).max(initial=0)))
        if d.max(initial=0) > largest:
            row, column, channel = np.unravel_index(d.argmax(), d.shape)
            largest, place = float(d[row, column, channel]), (y + int(row), int(column), int(channel))
    mean = (lambda total: total / count) if count else (lambda _: math.nan)
    return Difference(
        count=count,
        not_finite=not_finite,
        mae=mean(absolute),
        mse=mean(square),
        relative_mse=mean(relative),
        largest=largest,
        place=place,
        peak=top if peak is None else peak,
    )


def absolute_difference(reference: NDArray[Any], other: NDArray[Any]) -> NDArray[np.float64]:
    """|other - reference| in float64: 0 where both are equal, infinite or not, NaN where either is NaN."""
    a, b = reference.astype(np.float64), other.astype(np.float64)
    with np.errstate(invalid="ignore"):
        return np.where(a == b, 0.0, np.abs(b - a))
