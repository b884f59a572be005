"""Tiles of a film and the samples in them."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Ids
from illumcli.records import Record, Value

MIN_TILE_SAMPLES, MAX_TILE_SAMPLES = 1 << 12, 1 << 16
"""Samples per tile. Arrays of 2^14 samples stay in a core's cache, but switch threads at the interpreter lock
four times as often as arrays of 2^16, which costs more."""
TILES = 24
"""Tiles of an image, approximately, for threads to share; fewer if they would be too small."""
TILES_WITH_MARGINS = 12
"""The same where every tile is computed with a wide margin."""
MANY_NODES, MIN_SAMPLES_OF_MANY = 128, 1 << 15
"""If at least this many nodes run per tile, the smallest tiles are larger: threads wait for each other after
each node, at the interpreter lock."""


def min_tile_samples(nodes: int) -> int:
    """Samples of the smallest tiles that an image is divided into, if `nodes` run for each tile."""
    return MIN_SAMPLES_OF_MANY if nodes >= MANY_NODES else MIN_TILE_SAMPLES


def tile_side(samples: int, pixels: int, min_samples: int = MIN_TILE_SAMPLES, count: int = TILES) -> int:
    """Pixels along a square tile's side, a multiple of 8, of about `count` tiles.

    Tiles hold at least `min_samples` if they can.
    """
    shared = max(math.isqrt(min_samples // samples), math.isqrt(pixels // count))
    return max(8, min(shared, math.isqrt(MAX_TILE_SAMPLES // samples)) // 8 * 8)


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

    def in_blocks(self) -> NDArray[np.intp]:
        """(P,) the pixels in blocks of 4 by 4, and 2 by 2 within these: neighbours in all directions."""
        return _in_blocks(self.width, self.height)

    def grown(self, border: int, width: int, height: int) -> Tile:
        """The rectangle with a border of so many pixels, clipped to a film of this size."""
        x, y = max(self.x - border, 0), max(self.y - border, 0)
        right, lower = min(self.x + self.width + border, width), min(self.y + self.height + border, height)
        return Tile(x, y, right - x, lower - y)

    def within(self, other: Tile) -> tuple[slice, slice]:
        """The rows and columns of this rectangle within one that contains it."""
        x, y = self.x - other.x, self.y - other.y
        return slice(y, y + self.height), slice(x, x + self.width)


def tiles(width: int, height: int, side: int, samples: int, first: int = 0) -> list[list[Tile]]:
    """The tiles of an image of this size, or of `height` rows of one from its row `first` on, row by row:
    about squares of at most this side, and about equal, so that threads have equal work.

    At the end of the last row each tile is half of the remaining width, down to `MIN_TILE_SAMPLES`, so that
    all threads finish at about the same time.
    """
    out = []
    across, down = _equal_part(width, side), _equal_part(height, side)
    for y in range(0, height, down):
        tile_height, last = min(down, height - y), 0 < y >= height - down
        row, x = [], 0
        while rest := width - x:
            half = min(-(-rest // 16) * 8, rest)
            ending = last and rest <= 2 * across and half * tile_height * samples >= MIN_TILE_SAMPLES
            row.append(Tile(x, first + y, half if ending else min(across, rest), tile_height))
            x += row[-1].width
        out.append(row)
    return out


def _equal_part(length: int, longest: int) -> int:
    """The length of about equal parts, at most `longest`; a multiple of 8 if that is one."""
    step = 8 if longest % 8 == 0 else 1
    parts = -(-length // longest)
    return min(longest, -(-length // (parts * step)) * step)


class Scattered(Tile):
    """Any pixels of a film, as a tile of one row."""

    columns: NDArray[np.int64]
    rows: NDArray[np.int64]
    first: int = 0
    """Number of the first of them, among all that are rendered together."""

    @classmethod
    def at(cls, x: NDArray[np.int64], y: NDArray[np.int64], first: int = 0) -> Scattered:
        """The pixels of these columns and rows."""
        return cls(0, 0, len(x), 1, x, y, first)

    def numbers(self) -> NDArray[np.uint32]:
        """(P,) number of each; a pixel that is there several times has several."""
        return np.arange(self.first, self.first + self.width, dtype=np.uint32)

    def pixels(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        return self.columns, self.rows

    def in_blocks(self) -> NDArray[np.intp]:
        return np.arange(self.width)


@lru_cache(maxsize=32)
def _in_blocks(width: int, height: int) -> NDArray[np.intp]:
    """`Tile.in_blocks` of a size."""
    x, y = np.arange(width), np.arange(height)[:, None]
    block = y // 4 * -(-width // 4) + x // 4
    within = (x & 1) | (y & 1) << 1 | (x & 2) << 1 | (y & 2) << 2
    order = np.argsort((block << 4 | within).ravel())
    order.flags.writeable = False
    return order


class Samples(Record):
    """The samples of a tile, pixel by pixel, row by row from the top.

    Sample s of pixel p has the index p * per_pixel + s.
    """

    x: NDArray[np.int64]  # (P,) column of each pixel
    y: NDArray[np.int64]  # (P,) row of each pixel
    points: NDArray[np.float64]  # (N, 2) in [0, 1)^2
    per_pixel: int

    def nearest(self) -> Ids:
        """(P,) index of the sample nearest to each pixel's centre."""
        distance = np.square(self.points[:, 0] - 0.5) + np.square(self.points[:, 1] - 0.5)
        nearest = np.argmin(distance.reshape(-1, self.per_pixel), axis=1)
        return (nearest + np.arange(len(self.x)) * self.per_pixel).astype(np.int32)
