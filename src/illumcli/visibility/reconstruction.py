"""Reconstruction of w from few rays: local first-order regression on the normal and the position.

The noise of w differs from pixel to pixel, w itself follows the surface. So each pixel takes w from a
first-order polynomial of the normal that w is taken about and of the position, fitted to the raw values
around it. Objects are fitted apart: no value crosses from one object to another.

Pixels are grouped into cells of 2 x 2, whose moments are summed over square windows of a few radii. Each cell
takes the radius of the least estimated risk, and pixels the bilinear mean of the polynomials of the cells
around. Every sum is taken in one order that does not depend on where a tile begins: the values are the same
for any tiling.

References
----------
He, K., Sun, J. and Tang, X. (2010). Guided image filtering. ECCV.
Bitterli, B. et al. (2016). Nonlinearly weighted first-order regression for denoising Monte Carlo renderings.
Computer Graphics Forum 35(4). Not followed: its non-linear weights.
Li, T.-M., Wu, Y.-T. and Chuang, Y.-Y. (2012). SURE-based optimization for adaptive sampling and
reconstruction. ACM Transactions on Graphics 31(6).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.records import Record
from illumcli.visibility.object_pixels import FittedPixels, ObjectPixels, joined
from illumcli.visibility.regression import (
    COUNT,
    FEATURE,
    FEATURES,
    MOMENTS,
    PAIR,
    Planes,
    moments,
    polynomials,
)

CELL = 2
"""Pixels along a cell, which begin at even columns and rows of the film."""
RADII = (1, 2, 4, 8)
"""Of the windows that polynomials are fitted in [cells]: 6, 10, 18 and 34 pixels wide."""
SMOOTHING = 3
"""Radius of the windows that the risk is averaged over [cells]: one cell's own is too uncertain."""
MARGIN = CELL * (RADII[-1] + SMOOTHING + 1)
"""Pixels around a rectangle that its values depend on."""
COHERENCE = 0.75
"""Variance of a fit over what independent errors of the same size would give it: the rays of neighbouring
pixels are dithered, so that their errors cancel in part."""
CELLS_AT_ONCE = 1 << 13
"""Cells that are solved together: their moments fit into a core's own cache."""


def fitted_obscurance(object_pixels: ObjectPixels, surrounding_pixels: ObjectPixels) -> FittedPixels:
    """w of the pairs of a tile.

    Parameters
    ----------
    surrounding_pixels : ObjectPixels
        Those within `MARGIN` pixels around the tile.
    """
    count, around = len(object_pixels.x), len(surrounding_pixels.x)
    own = np.arange(count + around) < count
    return FittedPixels.of(object_pixels, reconstructed(joined([object_pixels, surrounding_pixels]), own))


def reconstructed(around: ObjectPixels, wanted: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(K,) float32 w of the K `wanted` pairs, in their order; exactly 1 where nothing around is hidden.

    Parameters
    ----------
    around : ObjectPixels
        All pairs within `MARGIN` pixels of the wanted ones.
    wanted : (G,) bool
    """
    out = np.ones(len(around.x), F)
    for sheet in _sheets(around, wanted):
        out[sheet.pair] = sheet.values()
    return out[wanted]


# --- objects side by side on sheets --------------------------------------------------------------------


class Sheet(Record):
    """Pixels of some objects, so far apart that no window holds two of them."""

    pixels: ObjectPixels
    pair: NDArray[np.intp]  # (G,) number of each pair
    row: NDArray[np.intp]  # (G,) pixel of the sheet
    column: NDArray[np.intp]  # (G,)
    shape: tuple[int, int]  # rows and columns of the sheet [cells]

    def values(self) -> NDArray[np.float32]:
        """(G,) float32 w of the pairs."""
        rows, columns = self.shape
        if not self.pixels.hidden.any():
            return np.ones(len(self.pair), F)
        at = self.row * (CELL * columns) + self.column
        flat = np.zeros((2 + FEATURES, CELL * rows * CELL * columns))
        values = (self.pixels.share, self.pixels.hidden, *self.pixels.features)
        for plane, each in zip(flat, values, strict=True):
            plane[at] = each
        planes = flat.reshape(-1, CELL * rows, CELL * columns)
        coefficients = cell_polynomials(cell_moments(planes[0], planes[1], planes[2:]))
        hidden = interpolated(coefficients, planes[2:]).ravel().take(at)
        return (1 - np.clip(hidden, 0, 1)).astype(F)


def _sheets(pixels: ObjectPixels, wanted: NDArray[np.bool_]) -> Iterator[Sheet]:
    """Sheets that hold every object of which a pair is wanted.

    The objects' bounding boxes stand side by side, a window's radius apart, those of like height together.
    """
    # bounding box of each object, from even columns and rows on
    order = np.argsort(pixels.object, kind="stable")
    first = np.flatnonzero(np.diff(pixels.object[order], prepend=-1))
    x, y = pixels.x[order], pixels.y[order]
    left, top = (np.minimum.reduceat(each, first) // CELL for each in (x, y))
    width, height = (
        np.maximum.reduceat(each, first) // CELL + 1 - low for each, low in ((x, left), (y, top))
    )
    ends = np.append(first[1:], len(order))
    needed = np.flatnonzero(np.logical_or.reduceat(wanted[order], first))
    needed = needed[np.argsort(height[needed], kind="stable")]

    # as many of them on a sheet as it holds
    gap = RADII[-1]
    step = width[needed] + gap
    k = 0
    while k < len(needed):
        end, across = k + 1, int(step[k])
        while end < len(needed):
            wider = across + int(step[end])
            if wider * int(height[needed[end]]) > CELLS_AT_ONCE:
                break
            end, across = end + 1, wider
        which = needed[k:end]
        place = np.cumsum(step[k:end]) - step[k:end]
        numbers = np.concatenate([np.arange(first[i], ends[i]) for i in which])
        sizes = ends[which] - first[which]
        pair = order[numbers]
        yield Sheet(
            pixels.take(pair),
            pair,
            y[numbers] - np.repeat(CELL * top[which], sizes).astype(np.intp),
            x[numbers] - np.repeat(CELL * (left[which] - place), sizes).astype(np.intp),
            (int(height[which].max()), across),
        )
        k = end


# --- fits over windows of cells -------------------------------------------------------------------------


def cell_moments(share: NDArray[np.float64], hidden: NDArray[np.float64], features: Planes) -> Planes:
    """(36, rows / 2, columns / 2) moments of the pixels of each cell, weighted by their `share`."""
    out = np.empty((MOMENTS, share.shape[0] // CELL, share.shape[1] // CELL))
    moments(share, hidden, features, _sum_cells, out)
    return out


def _sum_cells(pixels: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    rows = pixels[0::2] + pixels[1::2]
    np.add(rows[:, 0::2], rows[:, 1::2], out=out)


def window_sums(planes: Planes, radius: int) -> Planes:
    """Sums over windows of (2 radius + 1)^2 cells, zero outside.

    By halves of the window, so that each sum is taken in the same order wherever the array begins.
    """
    out = np.empty_like(planes)
    rows, columns = planes.shape[1:]
    padded = np.zeros((rows + 2 * radius, columns))
    across = np.zeros((rows, columns + 2 * radius))
    for plane, sums in zip(planes, out, strict=True):
        padded[radius : radius + rows] = plane
        _sum_rows(padded, radius, across[:, radius : radius + columns])
        _sum_rows(across.T, radius, sums.T)
    return out


def _sum_rows(padded: NDArray[np.float64], radius: int, out: NDArray[np.float64]) -> None:
    """Sums over 2 radius + 1 rows, from sums over 1, 2, 4, ... rows.

    Parameters
    ----------
    padded : (rows + 2 radius, columns) float64
    out : (rows, columns) float64
    """
    size, length = len(out), 2 * radius + 1
    run, width, offset = padded, 1, 1
    out[...] = padded[:size]
    while 2 * width <= length:
        rest = len(run) - width
        run = run[:rest] + run[width:]
        width *= 2
        if length & width:
            out += run[offset : offset + size]
            offset += width


class Fit(Record):
    """First-order polynomials fitted in the windows around all cells."""

    coefficients: Planes  # (7, rows, columns) constant and slopes of the hidden share
    at_cell: NDArray[np.float64]  # (rows, columns) value at the mean features of the cell itself
    leverage: NDArray[np.float64]  # (rows, columns) its variance per variance of a pixel
    square: NDArray[np.float64]  # (rows, columns) sum of the squared residuals over the window
    count: NDArray[np.float64]  # (rows, columns) pixels in the window


def fit(cells: Planes, radius: int) -> Fit:
    """The polynomial of least squares in the window around each cell."""
    of_windows = polynomials(window_sums(cells, radius))
    own = cells[FEATURE:PAIR] / np.maximum(cells[COUNT], 1e-30)
    return Fit(
        of_windows.coefficients(),
        of_windows.at(own),
        of_windows.leverage(own),
        of_windows.square,
        of_windows.count,
    )


def cell_polynomials(cells: Planes) -> Planes:
    """(8, rows, columns) coefficients of each cell's polynomial, of the radius of least risk, and whether
    the cell holds any pixel.

    The risk of radius k is the mean square of F_k - F_1, where F_1 is the fit in the smallest window, less
    what noise alone would give it, plus the variance of F_k: an unbiased estimate but for the bias of F_1.
    The variance of a pixel is that of the residuals in the smallest window.
    """
    # Fit the smallest windows, and estimate the variance of pixels from their residuals.
    held = cells[COUNT]
    smallest = fit(cells, RADII[0])
    freedom = np.maximum(smallest.count - (1 + FEATURES), 0.05 * smallest.count)
    squares, freedoms, weight = window_sums(
        np.stack([held * smallest.square, held * freedom, held]), SMOOTHING
    )
    variance = COHERENCE * squares / np.maximum(freedoms, 1e-30)
    weight = np.maximum(weight, 1e-30)

    # The risk of the smallest windows is their variance.
    best = smallest.coefficients
    mean_leverage = window_sums((held * smallest.leverage)[None], SMOOTHING)[0] / weight
    least = variance * mean_leverage

    # Take a wider fit where it has less risk.
    for radius in RADII[1:]:
        wider = fit(cells, radius)
        leverage, departure = (
            window_sums(
                np.stack([held * wider.leverage, held * np.square(wider.at_cell - smallest.at_cell)]),
                SMOOTHING,
            )
            / weight
        )
        risk = departure + variance * (2 * leverage - mean_leverage)
        better = risk < least
        least = np.where(better, risk, least)
        best = np.where(better, wider.coefficients, best)
    return np.concatenate([best, (held > 0)[None]])


def interpolated(coefficients: Planes, features: Planes) -> NDArray[np.float64]:
    """(rows, columns) hidden share of pixels: bilinear means of the polynomials of cells that hold pixels.

    Parameters
    ----------
    coefficients : (8, rows / 2, columns / 2) float64
        From `cell_polynomials`.
    features : (6, rows, columns) float64
    """
    there = coefficients[-1:]
    planes = np.concatenate([coefficients[:-1] * there, there])
    for axis in (1, 2):
        planes = _between(planes, axis)
    value = planes[0].copy()
    for slope, feature in zip(planes[1:-1], features, strict=True):
        value += slope * feature
    return value / np.maximum(planes[-1], 1e-30)


def _between(planes: Planes, axis: int) -> Planes:
    """Twice as many values along an axis, linear between the cells' centres; cells outside hold nothing."""
    shape = list(planes.shape)
    shape[axis] *= CELL
    out = np.empty(shape)
    near = 0.75 * planes
    far = 0.25 * planes
    for side in (0, 1):
        part = out[:, side::CELL] if axis == 1 else out[:, :, side::CELL]
        part[...] = near
        size = planes.shape[axis] - 1
        _part(part, axis, 1 - side, size)[...] += _part(far, axis, side, size)
    return out


def _part(planes: Planes, axis: int, first: int, size: int) -> Planes:
    return planes[:, first : first + size] if axis == 1 else planes[:, :, first : first + size]
