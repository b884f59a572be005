"""Histograms and lines of text as pictures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from illumcli.images.contact_sheet import display_buffer
from illumcli.images.openimageio import oiio
from illumcli.images.sheet_layout import GAP, LETTER, TEXT

BAR, AXIS = (96, 110, 128), (40, 40, 40)
"""Display values of bars and axes."""
LINE = TEXT + 6
"""Height of a line of text [pixels]."""


def text_picture(size: int, lines: Sequence[str]) -> NDArray[np.uint8]:
    """(size, size, 3) lines of black text on white, from the top."""
    picture = np.full((size, size, 3), 255, np.uint8)
    return _with_texts(picture, [(GAP, (k + 1) * LINE, line) for k, line in enumerate(lines)])


def histogram_picture(
    size: int, values: NDArray[np.floating], weights: NDArray[np.floating], title: str, bins: int = 50
) -> NDArray[np.uint8]:
    """(size, size, 3) a histogram of values from 0 to 1.

    Parameters
    ----------
    weights : (N,)
        What each value counts.
    """
    # The bars, the highest below the title; 1 falls into the last bin.
    counts, _ = np.histogram(values, bins, (0.0, 1.0), weights=weights)
    left, right, top, bottom = GAP, size - 2 * GAP, 2 * LINE, size - LINE - GAP
    heights = np.rint((bottom - top) * counts / max(counts.max(), 1e-30)).astype(int)
    picture = np.full((size, size, 3), 255, np.uint8)
    edges = np.rint(np.linspace(left, right, bins + 1)).astype(int)
    for first, end, height in zip(edges[:-1], edges[1:], heights, strict=True):
        picture[bottom - height : bottom, first : max(end - 1, first + 1)] = BAR

    # The axis, with its ends, middle and quarters.
    picture[bottom, left : right + 1] = AXIS
    texts = [(GAP, LINE, title)]
    for number in (0.0, 0.25, 0.5, 0.75, 1.0):
        x = round(left + number * (right - left))
        picture[bottom : bottom + 5, x] = AXIS
        label = f"{number:g}"
        at = min(max(x - LETTER * len(label) // 2, 0), size - LETTER * len(label))
        texts.append((at, bottom + LINE, label))
    return _with_texts(picture, texts)


def _with_texts(picture: NDArray[np.uint8], texts: Sequence[tuple[int, int, str]]) -> NDArray[np.uint8]:
    """The picture with texts at the left ends of their baselines."""
    buffer = display_buffer(picture)
    for x, y, text in texts:
        oiio.ImageBufAlgo.render_text(buffer, x, y, text, TEXT, "", (0.0, 0.0, 0.0))
    return np.asarray(buffer.get_pixels(oiio.UINT8))
