"""Interpolation between key frames, at many moments at once.

References
----------
Fritsch, F. N., Butland, J. (1984). A method for constructing local monotone piecewise cubic interpolants.
SIAM Journal on Scientific and Statistical Computing 5(2).
"""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Doubles: TypeAlias = NDArray[np.float64]
Interpolation: TypeAlias = Literal["linear", "smooth", "step"]


def interpolate(at: ArrayLike, positions: ArrayLike, values: ArrayLike, how: Interpolation) -> Doubles:
    """(N, C) values at moments; before the first key its own, after the last its own.

    Parameters
    ----------
    at : (N,) moments
    positions : (K,) of the keys, increasing
    values : (K, C) at the keys
    how : {'linear', 'smooth', 'step'}
        Straight from key to key; a cubic at rest at ends and extremes; or each value until the next key.
    """
    x, keys, y = (np.asarray(each, np.float64) for each in (at, positions, values))
    latest = np.searchsorted(keys, x, side="right") - 1
    if how == "step" or len(keys) == 1:
        return y[np.clip(latest, 0, len(keys) - 1)]

    # The interval of each moment, and the place in it.
    left = np.clip(latest, 0, len(keys) - 2)
    width = (keys[left + 1] - keys[left])[:, None]
    t = (np.clip(x, keys[0], keys[-1]) - keys[left])[:, None] / width
    a, b = y[left], y[left + 1]
    if how == "linear":
        return (1 - t) * a + t * b

    # Hermite's cubic with slopes that keep it between the keys.
    slope = _slopes(keys, y)
    rise = t * t * (3 - 2 * t)
    ends = t * (1 - t) * width
    return (1 - rise) * a + rise * b + ends * ((1 - t) * slope[left] - t * slope[left + 1])


def _slopes(keys: Doubles, values: Doubles) -> Doubles:
    """(K, C) 0 at ends and extremes, otherwise Fritsch and Butland's weighted harmonic mean."""
    width = np.diff(keys)[:, None]
    rise = np.diff(values, axis=0) / width
    before, after = width[:-1], width[1:]
    weight_before, weight_after = 2 * after + before, after + 2 * before
    goes_on = rise[:-1] * rise[1:] > 0
    one, other = (np.where(goes_on, each, 1) for each in (rise[:-1], rise[1:]))
    slopes = np.zeros_like(values)
    slopes[1:-1] = goes_on * ((weight_before + weight_after) / (weight_before / one + weight_after / other))
    return slopes
