"""The range of vertex colours in files: 0..1 or 0..255."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def unit_range(colors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colours scaled to a range of 0..1; `colors` itself, not copied, if they are in that range already.

    Colours are in 0..255 if some are above 1 and all are whole numbers, or their median is above 2. A few
    values above 1, by rounding or because they are very bright, do not count. NaN means no colour.
    """
    bright = colors[colors > 0]
    if not (bright > 1).any():
        return colors
    are_integers = bool((bright == np.floor(bright)).all())
    return colors / 255 if are_integers or np.median(bright) > 2 else colors
