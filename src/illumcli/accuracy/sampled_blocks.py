"""The pixels of a picture that audits draw from: all, or those of some blocks of a large picture."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.film.tiles import Tile
from illumcli.film.view import View
from illumcli.rays.sampling import hashed, stream, unit_interval
from illumcli.records import Record

MOST_PIXELS = 1 << 24
"""Pixels that are held, about: pictures with more are represented by blocks, drawn by hash."""
SIDE = 8
"""Pixels along such a block."""


class SampledBlocks(Record):
    """K blocks of a picture, one below the other, filled tile by tile."""

    values: NDArray[np.float32]  # (K * height, width, channels)
    x: NDArray[np.int64]  # (K,) left column of each block in the picture
    y: NDArray[np.int64]  # (K,) upper row
    is_inside: NDArray[np.bool_]  # (K * height * width,) blocks at the right and lower edge reach beyond them

    @classmethod
    def of(cls, view: View, channels: int, seed: int) -> SampledBlocks:
        """The whole picture as one block; of a large picture blocks of 8 x 8 pixels, each with the same
        chance."""
        width, height, pixels = view.width, view.height, view.width * view.height
        x, y = np.zeros(1, np.int64), np.zeros(1, np.int64)
        if pixels > MOST_PIXELS:
            across = -(-width // SIDE)
            number = np.arange(across * -(-height // SIDE))
            draw = unit_interval(hashed(stream(seed, "audit blocks"), number.astype(np.uint32)))
            y, x = np.divmod(number[draw < MOST_PIXELS / pixels], across)
            x, y, width, height = SIDE * x, SIDE * y, SIDE, SIDE
        columns = x[:, None, None] + np.arange(width)
        rows = y[:, None, None] + np.arange(height)[:, None]
        is_inside = ((columns < view.width) & (rows < view.height)).ravel()
        return cls(np.zeros((len(x) * height, width, channels), F), x, y, is_inside)

    def take(self, tile: Tile, values: NDArray[np.float32]) -> None:
        """Keep what blocks have of a tile, (rows, columns, channels)."""
        width, height = self.values.shape[1], len(self.values) // len(self.x)
        near = (self.x < tile.x + tile.width) & (self.x + width > tile.x)
        near &= (self.y < tile.y + tile.height) & (self.y + height > tile.y)
        for block in np.flatnonzero(near):
            x, y = int(self.x[block]), int(self.y[block])
            left, right = max(x, tile.x), min(x + width, tile.x + tile.width)
            upper, lower = max(y, tile.y), min(y + height, tile.y + tile.height)
            place = self.values[block * height : (block + 1) * height]
            place[upper - y : lower - y, left - x : right - x] = values[
                upper - tile.y : lower - tile.y, left - tile.x : right - tile.x
            ]

    def pixels(self, index: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Columns and rows, in the picture, of indices into the values."""
        width, height = self.values.shape[1], len(self.values) // len(self.x)
        row, column = np.divmod(index, width)
        block, row = np.divmod(row, height)
        return self.x[block] + column, self.y[block] + row
