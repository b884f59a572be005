"""Lobe shapes that several models share, in forms that keep their digits."""

from __future__ import annotations

from typing import Any

import numpy as np

from illumcli.arrays import Lanes


def lobe(gap: Lanes, exponent: Any) -> Lanes:
    """(N,) cos(angle)^exponent from gap = 1 - cos(angle); 0 at and beyond a right angle.

    A power of a rounded cosine loses exponent * 2^-53 of its value; with the gap formed as half the squared
    distance of two unit vectors, exp(e log1p(-gap)) keeps its digits for exponents of 10^6 and more.
    """
    inside = gap < 1
    safe = np.where(inside, gap, 0)
    return np.where(inside, np.exp(exponent * np.log1p(-safe)), 0)
