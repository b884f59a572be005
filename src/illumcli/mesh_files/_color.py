"""Vertex colours as files hold them, made linear."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def linear(srgb: ArrayLike) -> NDArray[np.float32]:
    """Linear light of sRGB-coded values in 0..1, by the two-part curve of IEC 61966-2-1 (1999)."""
    code = np.asarray(srgb, np.float64)
    return np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4).astype(np.float32)


def unit_range(colors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Colours of full 1, NaN where there is none; `colors` itself where they are.

    Of full 255 are those that are whole numbers, or most of which lie far beyond 1. A few that lie beyond 1,
    by rounding or being very bright, do not make bytes of the others.
    """
    bright = colors[colors > 0]
    if not (bright > 1).any():
        return colors
    whole = bool((bright == np.floor(bright)).all())
    return colors / 255 if whole or np.median(bright) > 2 else colors
