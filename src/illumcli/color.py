"""Linear Rec. 709 colours: the sRGB transfer curve, both ways, luminance, and images of linear values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.records import Record

Space: TypeAlias = Literal["srgb", "linear"] | None
"""The encoding of light in an image; None if it follows from the type of its numbers."""
LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of linear R, G and B in the luminance Y (ITU-R BT.709)."""


def to_srgb(linear: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
    """Display values of linear light, by the curve of IEC 61966-2-1 (1999), toe included.

    1 remains 1. The curve is continued above 1, its toe below 0; the precision is that of `linear`.
    """
    bright = np.maximum(linear, 0.0031308)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * bright ** (1 / 2.4) - 0.055)


def from_srgb(display: NDArray[np.floating[Any]]) -> NDArray[np.floating[Any]]:
    """Linear light of display values, the inverse of `to_srgb`."""
    bright = np.maximum(display, 0.04045)
    return np.where(display <= 0.04045, display / 12.92, ((bright + 0.055) / 1.055) ** 2.4)


class Texels(Record):
    """An image of linear values. Integers of 8 and 16 bits are kept, with a table of their linear values."""

    stored: NDArray[Any]  # (H, W, S) float32 linear values, or integers; the first row is the top
    channels: tuple[int, ...]  # C of the stored channels
    tables: NDArray[np.float32] | None = None  # (C, 256 or 65536) linear value of each integer

    @property
    def height(self) -> int:
        return int(self.stored.shape[0])

    @property
    def width(self) -> int:
        return int(self.stored.shape[1])

    def at(self, index: NDArray[np.integer[Any]]) -> NDArray[np.float32]:
        """(N, C) linear values of texels, numbered row by row from the top; components contiguous."""
        stored = self.stored.reshape(-1, self.stored.shape[2]).take(index, axis=0)
        out = np.empty((len(index), len(self.channels)), np.float32, order="F")
        for number, channel in enumerate(self.channels):
            column = stored[:, channel]
            out[:, number] = column if self.tables is None else self.tables[number].take(column)
        return out

    def select(self, channels: Sequence[int]) -> Texels:
        """Some of the channels; one may be taken several times. No texel is copied."""
        tables = None if self.tables is None else self.tables[list(channels)]
        return Texels(self.stored, tuple(self.channels[number] for number in channels), tables)

    def clipped(self, low: float, high: float) -> tuple[Texels, int]:
        """The image clipped to a range, and how many of its values were outside."""
        least, most = np.float32(low), np.float32(high)
        if self.tables is not None:
            is_outside = (self.tables < least) | (self.tables > most)
            outside = sum(
                int(np.count_nonzero(row[self.stored[..., channel]]))
                for row, channel in zip(is_outside, self.channels, strict=True)
                if row.any()
            )
            return replace(self, tables=np.clip(self.tables, least, most)), outside
        planes = [self.stored[..., channel] for channel in self.channels]
        outside = sum(int(np.count_nonzero((plane < least) | (plane > most))) for plane in planes)
        return (replace(self, stored=np.clip(self.stored, least, most)) if outside else self), outside


def luminance(color: NDArray[np.float64]) -> NDArray[np.float64]:
    """(...) luminance of linear R, G, B, (..., 3)."""
    return color @ np.array(LUMINANCE)
