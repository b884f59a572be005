"""Tiles of a film and the samples in them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Ids
from illumcli.records import Record, Value

FEWEST, MOST = 1 << 12, 1 << 16
"""Samples per tile. Passes over 2^14 stay in a core's own cache, but hand the interpreter from thread to
thread four times as often as those over 2^16, which costs more."""
TILES = 24
"""For threads to share a picture has about so many, where that makes them no smaller than `FEWEST`."""
MANY_STEPS, FEWEST_OF_MANY = 128, 1 << 14
"""Threads wait for the interpreter after each step: where a tile has many, fewer and larger tiles."""


def fewest_samples(steps: int) -> int:
    """Samples of the smallest tiles that a picture is divided into, where so many steps run for each."""
    return FEWEST_OF_MANY if steps >= MANY_STEPS else FEWEST


def tile_side(samples: int, pixels: int, fewest: int = FEWEST) -> int:
    """Pixels along a square tile's side, a multiple of 8; no tile is to hold fewer samples than `fewest`."""
    shared = max(math.isqrt(fewest // samples), math.isqrt(pixels // TILES))
    return max(8, min(shared, math.isqrt(MOST // samples)) // 8 * 8)


class Tile(Value):
    """A rectangle of pixels."""

    x: int
    y: int
    width: int
    height: int

    def pixels(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Column and row of every pixel, row by row from the top."""
        x, y = np.arange(self.x, self.x + self.width), np.arange(self.y, self.y + self.height)
        return np.tile(x, self.height), np.repeat(y, self.width)

    def grown(self, width: int, height: int) -> Tile:
        """The rectangle and a border of one pixel, within a film of this size."""
        x, y = max(self.x - 1, 0), max(self.y - 1, 0)
        right, lower = min(self.x + self.width + 1, width), min(self.y + self.height + 1, height)
        return Tile(x, y, right - x, lower - y)


def tiles(width: int, height: int, side: int, samples: int) -> list[list[Tile]]:
    """The tiles of a picture, row by row: squares, and the last of several rows ends in halves of what is
    left of it, as long as they hold `FEWEST` samples, so that threads end together."""
    out = []
    for y in range(0, height, side):
        own, last = min(side, height - y), 0 < y >= height - side
        row, x = [], 0
        while rest := width - x:
            half = min(-(-rest // 16) * 8, rest)
            ending = last and rest <= 2 * side and half * own * samples >= FEWEST
            row.append(Tile(x, y, half if ending else min(side, rest), own))
            x += row[-1].width
        out.append(row)
    return out


class Scattered(Tile):
    """Pixels that need not lie together, as a tile of one row."""

    columns: NDArray[np.int64]
    rows: NDArray[np.int64]

    @classmethod
    def at(cls, x: NDArray[np.int64], y: NDArray[np.int64]) -> Scattered:
        """The pixels of these columns and rows."""
        return cls(0, 0, len(x), 1, x, y)

    def pixels(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        return self.columns, self.rows


class Samples(Record):
    """The samples of a tile, pixel by pixel, row by row from the top: sample s of pixel p is lane
    p * per_pixel + s."""

    x: NDArray[np.int64]  # (P,) pixel
    y: NDArray[np.int64]  # (P,)
    points: NDArray[np.float64]  # (N, 2) in [0, 1)^2
    per_pixel: int
    first: int | None = None  # number of each pixel's first, where these are part of its samples

    def nearest(self) -> Ids:
        """(P,) the lane of the sample nearest to each pixel's centre."""
        distance = np.square(self.points[:, 0] - 0.5) + np.square(self.points[:, 1] - 0.5)
        nearest = np.argmin(distance.reshape(-1, self.per_pixel), axis=1)
        return (nearest + np.arange(len(self.x)) * self.per_pixel).astype(np.int32)
