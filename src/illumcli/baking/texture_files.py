"""Files of baked textures: PNG of 8 or 16 bits, and EXR with the error map. All of them are linear."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.baking.baked_texture import BakedTexture
from illumcli.film.channels import ChannelType
from illumcli.images.writer import ImageWriter
from illumcli.visibility.channels import CHANNELS, Arrays, chosen

BAND = 256
"""Rows that are written at once."""


EXR_NAMES: Mapping[str, tuple[str, ...]] = {
    "obscurance": ("Y",),
    "standard_error": ("error.Y",),
    "bent_normal": ("bent_normal.X", "bent_normal.Y", "bent_normal.Z"),
    "thickness": ("thickness.Y",),
    "thickness_error": ("thickness_error.Y",),
}
"""The channels of an EXR by those of a texture."""


def write_texture(
    path: Path, texture: BakedTexture, what: Sequence[str], about: Mapping[str, Any], bits: int
) -> None:
    """Write a texture.

    Parameters
    ----------
    path
        `.png`: one word of `--what`, in 8 or 16 `bits`: obscurance as it is, thickness as a share of its
        limit, components of directions d as (d + 1) / 2. `.exr`: all channels as they are, with their errors;
        `coverage.Y` is 1 where lookups on the surface read the texel, and 0 in gutters, which are filled.
    what
        The words of `--what` that the file holds.
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
    held = chosen(texture.channels, what)
    if path.suffix.lower() == ".exr":
        columns = _columns(held, texture.is_covered)
    else:
        name, values = next(iter(held.items()))
        limit = about["sampled"][name]["scale"] if name in about["sampled"] else 1.0
        if name == "thickness":
            metadata["illum:limit"] = repr(limit)
        columns = _steps(name, values / F(limit), bits)
    channels: dict[str, ChannelType] = {name: kind for name, (kind, _) in columns.items()}
    height, width = texture.is_covered.shape
    with ImageWriter(path, width, height, channels, metadata, srgb=False) as file:
        for y in range(0, height, BAND):
            file.write_band(y, np.stack([values[y : y + BAND] for _, values in columns.values()], axis=-1))


def _columns(held: Arrays, is_covered: NDArray[np.bool_]) -> dict[str, tuple[ChannelType, NDArray[Any]]]:
    """Channel of an EXR -> its type and values."""
    columns: dict[str, tuple[ChannelType, NDArray[Any]]] = {"coverage.Y": ("half", is_covered.astype(F))}
    for name, values in held.items():
        kind: ChannelType = "half" if name == "standard_error" else "float"
        planes = values[None] if values.ndim == 2 else np.moveaxis(values, 2, 0)
        columns |= {label: (kind, plane) for label, plane in zip(EXR_NAMES[name], planes, strict=True)}
    return columns


def _steps(name: str, values: NDArray[np.float32], bits: int) -> dict[str, tuple[ChannelType, NDArray[Any]]]:
    """The channels of a PNG, their type, and whole steps."""
    is_direction = CHANNELS[name].kind == "direction"
    shares = (values.astype(np.float64) + 1) / 2 if is_direction else values.astype(np.float64)
    steps = np.rint(np.clip(shares, 0, 1) * (2**bits - 1)).astype(np.uint8 if bits == 8 else np.uint16)
    planes = [steps[..., k] for k in range(3)] if is_direction else [steps]
    kind: ChannelType = "uint8" if bits == 8 else "uint16"
    return {label: (kind, plane) for label, plane in zip("RGB" if is_direction else "Y", planes, strict=True)}
