"""Functions on the unit square that depend on an angle: bilinear look-ups, and the inverse of a warp.

A density on a grid defines a warp of the square: uniformly distributed points become points of that density,
first the row by the marginal distribution, then the column within it. Between the angles of the table its
values and the integrals of the density are interpolated linearly, as the authors do.

References
----------
Dupuy, J., Jakob, W. (2018). An adaptive parameterization for efficient material acquisition and rendering.
ACM ToG 37(6), section 3; their `Marginal2D`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import column_major, take_rows

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Between(NamedTuple):
    """Positions between two neighbouring entries of a table."""

    low: Index
    """(N,) the entry below."""
    high: Index
    """(N,) the next one; the same in a table of one."""
    weight: Array
    """(N,) of the entry above, 0 to 1."""

    def blend(self, below: Array, above: Array) -> Array:
        """Values interpolated linearly; (N,), or (N, K) values per position."""
        weight = self.weight if below.ndim == 1 else self.weight[:, None]
        return below + weight * (above - below)


def between(grid: Array, value: Array) -> Between:
    """The place of each value in an ascending grid; outside of it, at its end."""
    low = np.clip(np.searchsorted(grid, value, "right") - 1, 0, max(len(grid) - 2, 0))
    high = np.minimum(low + 1, len(grid) - 1)
    step = np.where(high > low, grid[high] - grid[low], 1)
    return Between(low, high, np.clip((value - grid[low]) / step, 0, 1))


def between_even(u: Array, count: int) -> Between:
    """The place of `u`, 0 to 1, in `count` entries at even distances."""
    position = np.clip(u, 0, 1) * (count - 1)
    low = np.minimum(position.astype(np.int64), count - 2)
    return Between(low, low + 1, position - low)


class Lookup(NamedTuple):
    """Values on the unit square, for each angle of a table."""

    shape: tuple[int, int]
    """Rows and columns."""
    values: Array
    """(S * rows * columns, K) in column-major order."""

    @classmethod
    def of(cls, values: Array) -> Lookup:
        """From (S, K, rows, columns) values."""
        _, channels, *shape = values.shape
        return cls((shape[0], shape[1]), column_major(np.moveaxis(values, 1, -1).reshape(-1, channels)))

    def at(self, angle: Between, x: Array, y: Array) -> Array:
        """(N, K) interpolated at columns `x` and rows `y`, 0 to 1."""
        rows, columns = self.shape
        row, column = between_even(y, rows), between_even(x, columns)

        def along_row(slice_: Index, row_: Index) -> Array:
            first = (slice_ * rows + row_) * columns + column.low
            return column.blend(take_rows(self.values, first), take_rows(self.values, first + 1))

        def at_angle(slice_: Index) -> Array:
            return row.blend(along_row(slice_, row.low), along_row(slice_, row.high))

        return angle.blend(at_angle(angle.low), at_angle(angle.high))


class Warp(NamedTuple):
    """Densities on the unit square, for each angle of a table, and their integrals, which invert the warp."""

    shape: tuple[int, int]
    """Rows and columns."""
    patches: Array
    """(S * rows * columns, 3): the density here and in the next column, the integral of the row to here."""
    rows: Array
    """(S * rows, 2): the integral along the whole row, the integral of those up to here."""

    @classmethod
    def of(cls, density: Array) -> Warp:
        """From (S, rows, columns) densities, not negative; their scale does not matter."""
        along_row = np.zeros_like(density)
        np.cumsum((density[..., 1:] + density[..., :-1]) / 2, axis=-1, out=along_row[..., 1:])
        whole_row = along_row[..., -1]
        marginal = np.zeros_like(whole_row)
        np.cumsum((whole_row[:, 1:] + whole_row[:, :-1]) / 2, axis=-1, out=marginal[:, 1:])

        # Scale every slice to an integral of 1.
        total = marginal[:, -1, None]
        rows = np.stack([whole_row / total, marginal / total], axis=-1)
        following = np.concatenate([density[..., 1:], density[..., -1:]], axis=-1)
        patches = np.stack([density, following, along_row], axis=-1) / total[..., None, None]
        return cls(density.shape[1:], column_major(patches.reshape(-1, 3)), column_major(rows.reshape(-1, 2)))

    def invert(self, angle: Between, x: Array, y: Array) -> tuple[Array, Array]:
        """The columns and rows, 0 to 1, which the warp moves to columns `x` and rows `y`."""
        rows, columns = self.shape
        row, column = between_even(y, rows), between_even(x, columns)

        def at_angle(table: Array, place: Index, size: int) -> Array:
            low, high = (take_rows(table, slice_ * size + place) for slice_ in (angle.low, angle.high))
            return angle.blend(low, high)

        lower, upper = (
            at_angle(self.patches, each * columns + column.low, rows * columns)
            for each in (row.low, row.high)
        )
        lower_row, upper_row = (at_angle(self.rows, each, rows) for each in (row.low, row.high))

        # Along the row: its integral up to here, of the whole.
        here, following, integral = row.blend(lower, upper).T
        part = integral + column.weight * (here + column.weight / 2 * (following - here))
        whole = row.blend(lower_row[:, 0], upper_row[:, 0])
        along = np.divide(part, whole, out=np.zeros_like(part), where=whole > 0)

        # Across the rows: the integral of those before, and of this one up to here.
        first, second = lower_row[:, 0], upper_row[:, 0]
        return along, lower_row[:, 1] + row.weight * (first + row.weight / 2 * (second - first))
