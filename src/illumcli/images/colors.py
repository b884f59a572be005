"""The colours of an image, or its first channel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.film.channels import channel_count
from illumcli.images.reader import read_image
from illumcli.records import Record


class Colors(Record):
    """The values of an image that are shown and compared."""

    pixels: NDArray[np.float32]
    """(H, W, 3) R, G and B, or (H, W, 1) the first channel of an image without colours."""
    encoded: bool
    """True for display values, False for linear light."""
    metadata: dict[str, Any]


def read_colors(path: Path) -> Colors:
    """The colours of an image.

    Raises
    ------
    InputError
        As of `read_image`.
    """
    image = read_image(path)
    names = ("R", "G", "B") if channel_count(image.channels) == 3 else (next(iter(image.channels)),)
    pixels = np.stack([image.channels[name] for name in names], axis=-1)
    return Colors(pixels, image.encoded, image.metadata)
