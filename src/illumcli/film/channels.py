"""Channels of an image: their types, their names, and integers carried in bands of floats."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

ChannelType: TypeAlias = Literal["half", "float", "uint", "uint8", "uint16"]
Metadata: TypeAlias = Mapping[str, str | float | tuple[str, ...] | tuple[float, ...]]
"""Attribute name -> number, text, or tuple of numbers or of texts."""


def channel_types(names: Sequence[str], colour: Literal["half", "float"] = "half") -> dict[str, ChannelType]:
    """Channel name -> its type in an EXR: `colour` for R G B A of any layer, float for all other data."""
    return {name: colour if name.rpartition(".")[2] in tuple("RGBA") else "float" for name in names}


def group_by_layer(names: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Layer -> its channels. `P.X` is of layer `P`; R G B A Y without a layer are `beauty`; `Z` is `Z`."""
    groups: dict[str, tuple[str, ...]] = {}
    for name in names:
        layer = name.rpartition(".")[0] or ("beauty" if name in tuple("RGBAY") else name)
        groups[layer] = (*groups.get(layer, ()), name)
    return groups


def bits_of(numbers: NDArray[np.uint32]) -> NDArray[np.float32]:
    """Integers as the bands of an EXR hold them: the same bits, viewed as float32."""
    return np.ascontiguousarray(numbers).view(np.float32)


def numbers_of(bits: NDArray[np.float32]) -> NDArray[np.uint32]:
    """The inverse of `bits_of`."""
    return np.ascontiguousarray(bits).view(np.uint32)


def channel_count(names: Collection[str]) -> int:
    """3 where an image with these channels has colours, else 1: its first channel."""
    return 3 if {"R", "G", "B"} <= set(names) else 1
