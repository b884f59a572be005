"""What film and files both know of pixel values: the sRGB transfer curve, and that every value is finite."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import IllumError


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


def refuse_nonfinite(
    band: NDArray[Any], channels: Sequence[str], place: str, y0: int = 0, x0: int = 0
) -> None:
    """Nothing, where all of `band` is finite.

    Parameters
    ----------
    band : (h, W, C) float
        Of an image, `y0` and `x0` the numbers of its first row and column.
    channels : C names
    place : str
        What the error begins with, such as a file name.

    Raises
    ------
    IllumError
        Every channel that holds NaN or Inf, how many pixels, and the first of them.
    """
    if np.isfinite(band).all():
        return
    wrong = ~np.isfinite(band)
    facts = []
    for c, channel in enumerate(channels):
        rows, places = np.nonzero(wrong[..., c])
        if len(rows):
            first = f"the first at x {x0 + places[0]}, y {y0 + rows[0]}"
            facts.append(f"{place}: channel {channel}: NaN or infinite in {len(rows)} pixels, {first}")
    facts[-1] += "; nothing is written: render the layers one by one (--only) to find where they come from"
    raise IllumError("\n".join(facts))
