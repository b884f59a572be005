"""Scales that the axes of a view share."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from illumcli.brdf.views import Doubles

DECADES = 4
"""Range of a logarithmic scale below the largest value."""
STEEPEST = 85.0
"""Larger angles of view do not count for the scale: some models grow without bound there [degrees]."""


def scale(values: Sequence[Doubles], log: bool = False) -> float:
    """The largest of the values, rounded up to a number with few digits, above 0; a power of 10 if `log`."""
    largest = max((float(each.max()) for each in values), default=0.0)
    if not largest > 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(largest))
    steps = (1, 10) if log else (1, 1.5, 2, 3, 4, 5, 6, 8, 10)
    return float(next(step for step in steps if step * power >= largest * (1 - 1e-12)) * power)


def radius(values: Doubles, top: float, log: bool) -> Doubles:
    """Values as radii, 1 at `top` and beyond; on a logarithmic scale 0 at DECADES below."""
    share = np.minimum(values / top, 1)
    return np.maximum(1 + np.log10(np.maximum(share, 1e-300)) / DECADES, 0) if log else share
