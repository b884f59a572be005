"""Estimates of several cells from replicates, whose spread is the standard error."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from illumcli.arrays import Floats
from illumcli.records import Record

REPLICATES = 8
"""Independent estimates of every cell."""
MOST = 1 << 16
"""Samples of a cell beyond which no target error goes."""


class Estimate(Record):
    """C cells."""

    values: Floats  # (3, C) [1/sr], NaN without measurement
    errors: Floats  # (3, C) standard errors
    samples: int  # of each cell
    rays: int = 0


def relative_error(values: Floats, errors: Floats, weights: Floats) -> float:
    """Root mean square of the errors over that of the values, both times `weights`; 0 if all values are.

    The weights are n.l n.v, with which a BRDF becomes the light that is carried: without them the few largest
    values near the horizon would be all that counts.
    """
    seen = np.isfinite(values)
    squares = np.square(np.broadcast_to(weights, values.shape)[seen], dtype=np.float64)
    total = float(np.square(values[seen], dtype=np.float64) @ squares)
    return float(np.sqrt(np.square(errors[seen], dtype=np.float64) @ squares / total)) if total else 0.0


def of_replicates(replicates: Floats, most: Floats, samples: int) -> tuple[Floats, Floats]:
    """Means and standard errors of the mean of (..., R) replicates.

    To the spread of the replicates comes what one sample may change: something rare may not have come up.

    Parameters
    ----------
    most
        What a single sample contributes to the mean at most.
    samples
        Of all replicates, each of which contributes about alike.
    """
    mean = replicates.mean(axis=-1)
    spread = replicates.std(axis=-1, ddof=1) / np.sqrt(replicates.shape[-1])
    return mean, np.hypot(spread, np.where(mean > 0, np.minimum(mean / samples, most), most))


def to_target(
    estimate: Callable[[int, int], Estimate], samples: int, target: float | None, weights: Floats
) -> Estimate:
    """The estimate of `samples` samples per cell, or of so many that the relative error is at most `target`.

    Parameters
    ----------
    estimate : callable
        From the number of samples and the number of the attempt: attempts are independent.
    """
    found, attempt = estimate(samples, 0), 1
    while target is not None and found.samples < MOST:
        reached = relative_error(found.values, found.errors, weights)
        if reached <= target:
            break
        # Errors fall at least as the root of the samples: a few more than that asks for.
        wanted = found.samples * min(max(1.2 * (reached / target) ** 2, 1.5), 16)
        count = min(-(-int(wanted) // REPLICATES) * REPLICATES, MOST)
        rays = found.rays
        found = estimate(count, attempt)
        found = Estimate(found.values, found.errors, found.samples, found.rays + rays)
        attempt += 1
    return found
