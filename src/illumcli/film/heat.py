"""Heat images: false colours whose lightness grows with the value."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# sRGB; the lightness L* of CIE 1976 is 0, 20, 40, 59, 80, 98, and linear in between to within 4
COLOURS = ((0, 0, 0), (62, 24, 128), (165, 44, 125), (238, 98, 62), (253, 184, 64), (255, 250, 205))
NOT_FINITE = (0, 255, 255)


def heat(values: NDArray[np.floating[Any]], scale: float) -> NDArray[np.uint8]:
    """(H, W, 3) uint8, sRGB: black at 0, violet, red, orange, pale yellow from `scale` on; else cyan.

    Parameters
    ----------
    values : (H, W) float, at least 0
        Cyan where it is not finite.
    scale : float
        Above 0.
    """
    stops = np.linspace(0, scale, len(COLOURS))
    finite = np.isfinite(values)
    safe = np.where(finite, values, 0)
    channels = [np.interp(safe, stops, column) for column in zip(*COLOURS, strict=True)]
    colours = np.rint(np.stack(channels, axis=-1)).astype(np.uint8)
    colours[~finite] = NOT_FINITE
    return colours
