"""The values of a picture that a sweep compares and shows."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError, OutputError


def channel_count(names: Collection[str]) -> int:
    """3 where an image with these channels has colours, else 1: its first channel."""
    return 3 if {"R", "G", "B"} <= set(names) else 1


def colors(path: Path) -> tuple[NDArray[np.float32], bool]:
    """(H, W, 3) R, G and B of an image, or (H, W, 1) its first channel if it has no colours; and whether the
    values are display values."""
    from illumcli.images.reader import read_image

    image = read_image(path)
    names = ("R", "G", "B") if channel_count(image.channels) == 3 else (next(iter(image.channels)),)
    return np.stack([image.channels[name] for name in names], axis=-1), image.encoded


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
