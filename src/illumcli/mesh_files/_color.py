"""The range of vertex colours as files hold them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def unit_range(colors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colours of full 1, NaN where there is none; `colors` itself where they are.

    Of full 255 are those that are whole numbers, or most of which lie far beyond 1. A few that lie beyond 1,
    by rounding or being very bright, do not make bytes of the others.
    """
    bright = colors[colors > 0]
    if not (bright > 1).any():
        return colors
    are_integers = bool((bright == np.floor(bright)).all())
    return colors / 255 if are_integers or np.median(bright) > 2 else colors
