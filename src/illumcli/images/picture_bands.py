"""Bands of rows of a picture, each in a file of its own, and the picture that is joined from them."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from illumcli.film.channels import ChannelType, Metadata
from illumcli.images.reader import ImageSource
from illumcli.images.writer import ImageWriter

PICTURE = "illum:picture"
"""Metadata of a band: the height, channels and metadata of the picture, as JSON."""


def picture_text(height: int, channels: Mapping[str, ChannelType], metadata: Metadata, srgb: bool) -> str:
    """What a band says of its picture; the arguments are those of the picture's `ImageWriter`."""
    facts = {"height": height, "channels": channels, "metadata": metadata, "srgb": srgb}
    return json.dumps(facts, default=float)


def join_bands(bands: Sequence[Path], picture: Path) -> None:
    """Write the picture of some bands, in their order from the top. A few rows are in memory.

    Raises
    ------
    InputError
        A band cannot be read.
    OutputError
        The picture cannot be written.
    """
    with ImageSource(bands[0]) as source:
        facts, width = json.loads(source.metadata()[PICTURE]), source.width
    channels, metadata = facts["channels"], {name: _value(each) for name, each in facts["metadata"].items()}
    dtype: type[Any] = np.uint8 if picture.suffix.lower() == ".png" else np.float32
    with ImageWriter(picture, width, facts["height"], channels, metadata, facts["srgb"]) as writer:
        y = 0
        for band in bands:
            with ImageSource(band) as source:
                order = source.order(tuple(channels))
                for rows in source.bands(dtype):
                    writer.write_band(y, rows if order is None else rows[..., order])
                    y += len(rows)


def _value(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
