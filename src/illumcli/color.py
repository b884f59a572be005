"""Linear Rec. 709 colours: the sRGB transfer curve, both ways, and luminance."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

Space: TypeAlias = Literal["srgb", "linear"] | None
"""How the numbers of an image code light; None where their type decides."""
LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of linear R, G and B in the luminance Y (ITU-R BT.709)."""


def to_srgb(linear: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
    """Display values of linear light, by the curve of IEC 61966-2-1 (1999), toe included.

    1 stays 1. The curve goes on above 1, and below 0 the toe does; the precision is that of `linear`.
    """
    bright = np.maximum(linear, 0.0031308)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * bright ** (1 / 2.4) - 0.055)


def from_srgb(display: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
    """Linear light of display values, the inverse of `to_srgb`."""
    bright = np.maximum(display, 0.04045)
    return np.where(display <= 0.04045, display / 12.92, ((bright + 0.055) / 1.055) ** 2.4)


def luminance(color: NDArray[np.float64]) -> NDArray[np.float64]:
    """(...) luminance of linear R, G, B, (..., 3)."""
    return color @ np.array(LUMINANCE)
