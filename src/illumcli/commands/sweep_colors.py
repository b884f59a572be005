"""The values of a picture that a sweep compares and shows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError, OutputError


def colors(path: Path) -> tuple[NDArray[np.float32], bool]:
    """(H, W, 3) R, G and B of an image, or (H, W, 1) its first channel if it has no colours; and whether the
    values are display values."""
    from illumcli.images.colors import read_colors

    image = read_colors(path)
    return image.pixels, image.encoded


def written_colors(path: Path) -> tuple[NDArray[np.float32], bool]:
    """The `colors` of an image that this sweep wrote.

    Raises
    ------
    OutputError
        It does not exist any more.
    """
    try:
        return colors(path)
    except InputError as error:
        raise OutputError(f"{path}: was written, but has been removed since; run the sweep again") from error
