"""Pixels of objects, laid out on sheets: so far apart that no window of pixels holds two objects."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.records import Record, Value
from illumcli.visibility.object_pixels import ObjectPixels
from illumcli.visibility.regression import FEATURES

CELL = 2
"""Pixels along a cell, which begin at even columns and rows of the film."""
BLOCK = 4
"""Cells along a block, which begin at every eighth column and row of the film."""
GAP = 2
"""Empty blocks between two objects."""
CELLS_AT_ONCE = 1 << 13
"""Cells of a sheet, unless one object takes more."""


class Area(Value):
    """A rectangle of cells."""

    top: int
    bottom: int
    left: int
    right: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.bottom - self.top, self.right - self.left

    @property
    def slices(self) -> tuple[slice, slice]:
        """The rows and columns."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    def finer(self) -> Area:
        """The same rectangle in cells of half the size."""
        return Area(2 * self.top, 2 * self.bottom, 2 * self.left, 2 * self.right)

    def coarser(self, border: int) -> Area:
        """The least rectangle of cells of twice the size that holds this one and a border of such cells."""
        top, left = self.top // 2 - border, self.left // 2 - border
        return Area(top, -(-self.bottom // 2) + border, left, -(-self.right // 2) + border)

    def clipped(self, shape: tuple[int, int]) -> Area:
        """The part that lies in an array of this shape."""
        rows, columns = shape
        return Area(max(self.top, 0), min(self.bottom, rows), max(self.left, 0), min(self.right, columns))


class Sheet(Record):
    """Pixels of some objects."""

    pair: NDArray[np.intp]  # (G,) number of each pair
    place: NDArray[np.intp]  # (G,) in its cell: 0 and 1 in the upper row, 2 and 3 in the lower one
    row: NDArray[np.intp]  # (G,) of cells
    column: NDArray[np.intp]  # (G,)
    shape: tuple[int, int]  # rows and columns of cells, whole blocks
    wanted: Area

    def planes(self, pixels: ObjectPixels) -> NDArray[np.float32]:
        """(8, 4, rows, columns) share, hidden share and features of the pixels by place; 0 elsewhere."""
        rows, columns = self.shape
        at = (self.place * rows + self.row) * columns + self.column
        flat = np.zeros((2 + FEATURES, 4 * rows * columns), F)
        for plane, values in zip(flat, (pixels.share, pixels.hidden, *pixels.features), strict=True):
            plane[at] = values.take(self.pair)
        return flat.reshape(-1, 4, rows, columns)


def sheets(pixels: ObjectPixels, wanted: NDArray[np.bool_]) -> Iterator[Sheet]:
    """Sheets that hold every object of which a pair is wanted.

    The objects' bounding boxes stand side by side, those of like height together.
    """
    # bounding box of each object [blocks]
    order = np.argsort(pixels.object, kind="stable")
    first = np.flatnonzero(np.diff(pixels.object[order], prepend=-1))
    ends = np.append(first[1:], len(order))
    x, y = pixels.x.take(order), pixels.y.take(order)
    side = CELL * BLOCK
    left, top = (np.minimum.reduceat(each, first) // side for each in (x, y))
    width, height = (
        np.maximum.reduceat(each, first) // side + 1 - low for each, low in ((x, left), (y, top))
    )
    needed = np.flatnonzero(np.logical_or.reduceat(wanted.take(order), first))
    needed = needed[np.argsort(height[needed], kind="stable")]

    # as many of them on a sheet as it holds
    step = width[needed] + GAP
    k = 0
    while k < len(needed):
        end, across = k + 1, int(step[k])
        while end < len(needed):
            wider = across + int(step[end])
            if wider * int(height[needed[end]]) * BLOCK**2 > CELLS_AT_ONCE:
                break
            end, across = end + 1, wider
        which = needed[k:end]
        place = np.cumsum(step[k:end]) - step[k:end]
        spans = [slice(first[i], ends[i]) for i in which]
        sizes = ends[which] - first[which]
        row, column = (
            np.concatenate([each[span] for span in spans]) - np.repeat(side * low, sizes)
            for each, low in ((y, top[which]), (x, left[which] - place))
        )
        pair = np.concatenate([order[span] for span in spans])
        shape = BLOCK * int(height[which].max()), BLOCK * across
        yield _sheet(pair, row.astype(np.intp), column.astype(np.intp), shape, wanted.take(pair))
        k = end


def _sheet(
    pair: NDArray[np.intp],
    row: NDArray[np.intp],
    column: NDArray[np.intp],
    shape: tuple[int, int],
    wanted: NDArray[np.bool_],
) -> Sheet:
    """The sheet of pairs whose rows and columns are counted in pixels."""
    down, across = row[wanted] // CELL, column[wanted] // CELL
    area = Area(int(down.min()), int(down.max()) + 1, int(across.min()), int(across.max()) + 1)
    return Sheet(pair, (row & 1) * 2 + (column & 1), row >> 1, column >> 1, shape, area)
