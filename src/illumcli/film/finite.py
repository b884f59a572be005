"""Refuses images with values that are NaN or infinite."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import IllumError


def refuse_nonfinite(
    band: NDArray[Any], channels: Sequence[str], place: str, y0: int = 0, x0: int = 0
) -> None:
    """Check that all values of `band` are finite.

    Parameters
    ----------
    band : (h, W, C) float
        A part of an image; `y0` and `x0` are the numbers of its first row and column.
    channels : C names
    place : str
        Beginning of the error, such as a file name.

    Raises
    ------
    IllumError
        Lists each channel with NaN or infinite values, the number of these pixels, and the first of them.
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
