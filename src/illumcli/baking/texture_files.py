"""Files of baked textures: PNG of 8 or 16 bits, and EXR with the error map. All of them are linear."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.baking.baked_texture import BakedTexture
from illumcli.film.channels import ChannelType
from illumcli.images.writer import ImageWriter

BAND = 256
"""Rows that are written at once."""


def write_texture(path: Path, texture: BakedTexture, about: Mapping[str, Any], bits: int) -> None:
    """Write a texture.

    Parameters
    ----------
    path
        `.png`: obscurance alone, in 8 or 16 `bits`. `.exr`: `Y` is obscurance, `error.Y` its standard error,
        `coverage.Y` is 1 where lookups on the surface read the texel, and 0 in gutters, which are filled.
    about
        Kept as JSON in the metadata; its `content` and `version` are texts of their own.
    """
    metadata = {
        "Software": f"illum {about['version']}",
        "illum:content": about["content"],
        "illum:encoding": "linear",
        "illum:texture": texture.name,
        "illum:about": json.dumps(about),
    }
    columns = _columns(texture) if path.suffix.lower() == ".exr" else _steps(texture, bits)
    channels: dict[str, ChannelType] = {name: kind for name, (kind, _) in columns.items()}
    height, width = texture.is_covered.shape
    with ImageWriter(path, width, height, channels, metadata, srgb=False) as file:
        for y in range(0, height, BAND):
            file.write_band(y, np.stack([values[y : y + BAND] for _, values in columns.values()], axis=-1))


def _columns(texture: BakedTexture) -> dict[str, tuple[ChannelType, NDArray[Any]]]:
    """Channel of an EXR -> its type and values."""
    return {
        "Y": ("float", texture.channels["obscurance"]),
        "coverage.Y": ("half", texture.is_covered.astype(F)),
        "error.Y": ("half", texture.channels["standard_error"]),
    }


def _steps(texture: BakedTexture, bits: int) -> dict[str, tuple[ChannelType, NDArray[Any]]]:
    """The channel of a PNG, its type, and whole steps."""
    steps = np.rint(np.clip(texture.channels["obscurance"], 0, 1).astype(np.float64) * (2**bits - 1))
    return {"Y": ("uint8", steps.astype(np.uint8)) if bits == 8 else ("uint16", steps.astype(np.uint16))}
