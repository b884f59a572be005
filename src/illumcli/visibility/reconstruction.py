"""Reconstruction of w from few rays: local first-order regression on the normal and the position.

The noise of w differs from pixel to pixel, w itself follows the surface. So each pixel takes w from a
first-order polynomial of the normal that w is taken about and of the position, fitted to the raw values
around it. Objects are fitted apart: no value crosses from one object to another.

Pixels are grouped into cells of 2 x 2, these into cells of 4 x 4 and 8 x 8: the wider a window, the coarser
the cells that it is made of and that get a polynomial of it. Each cell of 4 x 4 takes the window of the least
estimated risk, and pixels the bilinear mean of the polynomials of the cells around. Every sum is taken in one
order that does not depend on where a tile begins: the values are the same for any tiling.

References
----------
He, K., Sun, J. and Tang, X. (2010). Guided image filtering. ECCV.
Bitterli, B. et al. (2016). Nonlinearly weighted first-order regression for denoising Monte Carlo renderings.
Computer Graphics Forum 35(4). Not followed: its non-linear weights.
Li, T.-M., Wu, Y.-T. and Chuang, Y.-Y. (2012). SURE-based optimization for adaptive sampling and
reconstruction. ACM Transactions on Graphics 31(6).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats
from illumcli.records import Record
from illumcli.visibility.compiled_fits import fit_loop
from illumcli.visibility.object_pixels import FittedPixels, ObjectPixels, joined
from illumcli.visibility.regression import (
    COUNT,
    FEATURE,
    FEATURES,
    HIDDEN,
    MOMENTS,
    PAIR,
    Planes,
    moments,
    polynomials,
)
from illumcli.visibility.sheets import CELL, Area, sheets

WINDOWS = ((0, 1), (1, 1), (2, 1), (2, 2))
"""Level and radius [cells of that level] of the windows: 6, 12, 24 and 40 pixels wide. Level 0 has cells of
2 x 2 pixels, each further one cells of twice the size."""
BORDERS = (1, 1, 2)
"""Empty cells around each level, as wide as its widest windows reach."""
SMOOTHING = 2
"""Radius of the windows that the risk is averaged over [cells of level 1]: one cell's own is too uncertain.
"""
MARGIN = CELL * (1 + 2 * (1 + SMOOTHING) + 4 * (1 + BORDERS[-1]))
"""Pixels around a rectangle that its values depend on: a pixel depends on the polynomials of the cells beside
its own, these on the coarser ones beside them."""
COHERENCE = 0.75
"""Variance of a fit over what independent errors of the same size would give it: the rays of neighbouring
pixels are dithered, so that their errors cancel in part."""
STRIP = 1 << 12
"""Cells whose moments are summed and solved together: they fit into a core's own cache."""


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
    for sheet in sheets(around, wanted):
        planes = sheet.planes(around)
        if not planes[1].any():
            continue

        # The polynomials of the cells around what is wanted, and their values there.
        levels = pyramid(planes)
        area = sheet.wanted.coarser(1 + SMOOTHING).clipped(levels[1].shape)
        coefficients = cell_polynomials(levels, area)
        area = area.finer()
        rows, columns = area.slices
        hidden = interpolated(coefficients, planes[2:, :, rows, columns])

        # Read them at the pixels.
        own = wanted.take(sheet.pair)
        row, column = sheet.row[own] - area.top, sheet.column[own] - area.left
        at = (sheet.place[own] * hidden.shape[1] + row) * hidden.shape[2] + column
        out[sheet.pair[own]] = (1 - np.clip(hidden.ravel().take(at), 0, 1)).astype(F)
    return out[wanted]


# --- moments of cells and windows -----------------------------------------------------------------------


class Cells(Record):
    """Moments of the pixels of each cell, weighted by their share, with a border of empty cells."""

    moments: Planes  # (36, rows + 2 border, columns + 2 border)
    border: int

    @classmethod
    def empty(cls, shape: tuple[int, int], border: int) -> Cells:
        """Cells without pixels."""
        rows, columns = shape
        return cls(np.zeros((MOMENTS, rows + 2 * border, columns + 2 * border)), border)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns without the border."""
        _, rows, columns = self.moments.shape
        return rows - 2 * self.border, columns - 2 * self.border

    def within(self, area: Area, grown: int = 0) -> Planes:
        """(36, rows, columns) moments of an area, grown by so many cells on all sides."""
        start, end = self.border - grown, self.border + grown
        rows = slice(area.top + start, area.bottom + end)
        return self.moments[:, rows, area.left + start : area.right + end]


def pyramid(planes: NDArray[np.float32]) -> list[Cells]:
    """The cells of all levels.

    Parameters
    ----------
    planes : (8, 4, rows, columns) float32
        Share, hidden share and features of the pixels of each cell of level 0.
    """
    shape = planes.shape[2:]
    levels = [Cells.empty((shape[0] >> k, shape[1] >> k), border) for k, border in enumerate(BORDERS)]
    everything = Area(0, shape[0], 0, shape[1])
    loop = fit_loop()
    if loop is not None:
        loop.cell_moments(planes, levels[0].within(everything))
    else:
        for strip in strips(everything):
            each = planes[:, :, strip.top : strip.bottom].astype(np.float64)
            moments(each[0], each[1], each[2:], _sum_places, levels[0].within(strip))
    for fine, coarse in pairwise(levels):
        everything = Area(0, coarse.shape[0], 0, coarse.shape[1])
        _sum_cells(fine.within(everything.finer()), coarse.within(everything))
    return levels


def strips(area: Area) -> Iterator[Area]:
    """Strips of rows of an area."""
    step = max(STRIP // max(area.right - area.left, 1), 1)
    for top in range(area.top, area.bottom, step):
        yield Area(top, min(top + step, area.bottom), area.left, area.right)


def _sum_places(pixels: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """Sums over the pixels of each cell, (4, rows, columns)."""
    np.add(pixels[0], pixels[1], out=out)
    out += pixels[2] + pixels[3]


def _sum_cells(planes: Planes, out: Planes) -> None:
    """Sums over 2 x 2 cells."""
    loop = fit_loop()
    if loop is not None:
        loop.sum_cells(planes, out)
        return
    rows = planes[:, 0::2] + planes[:, 1::2]
    np.add(rows[:, :, 0::2], rows[:, :, 1::2], out=out)


def window_sums(planes: Planes, radius: int) -> Planes:
    """(K, rows, columns) sums over windows of (2 radius + 1)^2 values.

    Each sum is taken in the same order wherever the array begins.

    Parameters
    ----------
    planes : (K, rows + 2 radius, columns + 2 radius) float64
    """
    rows, columns = planes.shape[1] - 2 * radius, planes.shape[2] - 2 * radius
    down = planes[:, :rows] + planes[:, 1 : 1 + rows]
    for k in range(2, 2 * radius + 1):
        down += planes[:, k : k + rows]
    sums = down[:, :, :columns] + down[:, :, 1 : 1 + columns]
    for k in range(2, 2 * radius + 1):
        sums += down[:, :, k : k + columns]
    return sums


def _averages(planes: Planes) -> Planes:
    """Sums over the windows that risks are averaged over, empty outside."""
    border = ((0, 0), (SMOOTHING, SMOOTHING), (SMOOTHING, SMOOTHING))
    return window_sums(np.pad(planes, border), SMOOTHING)


# --- fits -----------------------------------------------------------------------------------------------


class Fit(Record):
    """First-order polynomials fitted in the windows around cells; 0 where nothing in a window is hidden."""

    coefficients: Planes  # (7, rows, columns) constant and slopes of the hidden share
    at_cell: NDArray[np.float64]  # (rows, columns) value at the mean features of the cell itself
    leverage: NDArray[np.float64]  # (rows, columns) its variance per variance of a pixel
    square: NDArray[np.float64]  # (rows, columns) sum of the squared residuals over the window
    count: NDArray[np.float64]  # (rows, columns) pixels in the window

    @classmethod
    def of(cls, planes: Planes) -> Fit:
        """The fits whose values are (11, rows, columns)."""
        return cls(planes[: 1 + FEATURES], *planes[1 + FEATURES :])


def fit(cells: Cells, radius: int, area: Area) -> Fit:
    """The polynomial of least squares in the window around each cell of an area."""
    out = np.zeros((FEATURES + 5, *area.shape))
    loop = fit_loop()
    if loop is not None:
        loop.window_fits(cells.within(area), radius, out)
        return Fit.of(out)
    for strip in strips(area):
        held = cells.within(strip)
        sums = window_sums(cells.within(strip, radius), radius)
        place = out[:, strip.top - area.top : strip.bottom - area.top]
        place[-1] = sums[COUNT]

        # Solve where a window has something hidden.
        some = (held[COUNT] > 0) & (sums[HIDDEN] > 0)
        own = held[FEATURE:PAIR] / np.maximum(held[COUNT], 1e-30)
        if some.all():
            place[:-1] = _solved(sums, own)
            continue
        np.divide(1, np.maximum(sums[COUNT], 1), out=place[-3])
        which = np.flatnonzero(some)
        if len(which):
            few = (each.reshape(len(each), -1).take(which, axis=1) for each in (sums, own))
            for plane, values in zip(place[:-1], _solved(*few), strict=True):
                plane.reshape(-1)[which] = values
    return Fit.of(out)


def _solved(sums: Planes, own: Planes) -> Planes:
    """(10, ...) coefficients, value and leverage at a cell's own features, sum of the squared residuals."""
    of_windows = polynomials(sums)
    return np.stack(
        [*of_windows.coefficients(), of_windows.at(own), of_windows.leverage(own), of_windows.square]
    )


def cell_polynomials(levels: list[Cells], area: Area) -> Planes:
    """(8, 2 rows, 2 columns) coefficients of the polynomial of each cell of level 0, of the window of least
    risk, and whether the cell holds any pixel.

    The risk of window k is the mean square of F_k - F_0, where F_0 is the fit in the smallest window, less
    what noise alone would give it, plus the variance of F_k: an unbiased estimate but for the bias of F_0.
    The variance of a pixel is that of the residuals in the smallest window.

    Parameters
    ----------
    area : Area
        Cells of level 1.
    """
    # Fit the smallest windows. Estimate the variance of pixels from their residuals.
    finest = levels[0].within(area.finer())
    smallest = fit(levels[0], WINDOWS[0][1], area.finer())
    freedom = np.maximum(smallest.count - (1 + FEATURES), 0.05 * smallest.count)
    own = finest[FEATURE:PAIR] / np.maximum(finest[COUNT], 1e-30)
    of_cells = np.stack([finest[COUNT], smallest.square, freedom, smallest.leverage, smallest.at_cell, *own])
    weight, squares, freedoms, leverages, at_cell, *own = _by_place(of_cells)
    sums = np.empty((4, *area.shape))
    _sum_places(weight, sums[0])
    for values, out in zip((squares, freedoms, leverages), sums[1:], strict=True):
        _sum_places(weight * values, out)
    held = sums[0]
    total, squares, freedoms, leverages = _averages(sums)
    per_weight = 1 / np.maximum(total, 1e-30)
    variance = COHERENCE * squares / np.maximum(freedoms, 1e-30)

    # The risk of the smallest windows is their variance. Take a wider fit where it has less.
    mean_leverage = leverages * per_weight
    least = variance * mean_leverage
    best: Planes | None = None
    is_wider = np.zeros(area.shape, np.bool_)
    for level, radius in WINDOWS[1:]:
        coefficients, leverage = wider_fit(levels, level, radius, area)
        sums = np.empty((2, *area.shape))
        _sum_places(weight * np.square(_value(coefficients, own) - at_cell), sums[0])
        np.multiply(held, leverage, out=sums[1])
        departure, leverage = _averages(sums) * per_weight
        risk = departure + variance * (2 * leverage - mean_leverage)
        better = risk < least
        least = np.where(better, risk, least)
        best = coefficients if best is None else np.where(better, coefficients, best)
        is_wider |= better
    assert best is not None
    wider = finer(best, held > 0)
    is_wider = is_wider.repeat(2, axis=0).repeat(2, axis=1)
    there = finest[COUNT] > 0
    return np.concatenate([np.where(is_wider, wider, smallest.coefficients), there[None]])


def _by_place(planes: Planes) -> Planes:
    """(K, 4, rows, columns) values of 2 x 2 cells, (K, 2 rows, 2 columns), side by side."""
    return np.stack([planes[:, y::2, x::2] for y in (0, 1) for x in (0, 1)], axis=1)


def wider_fit(levels: list[Cells], level: int, radius: int, area: Area) -> tuple[Planes, Planes]:
    """Coefficients and leverage of the fits of a level at the cells of an area of level 1."""
    wide = area
    for cells in levels[2 : level + 1]:
        wide = wide.coarser(1).clipped(cells.shape)
    fits = fit(levels[level], radius, wide)
    planes = np.concatenate([fits.coefficients, fits.leverage[None]])
    for cells in reversed(levels[2 : level + 1]):
        planes, wide = finer(planes, cells.within(wide)[COUNT] > 0), wide.finer()
    top, left = area.top - wide.top, area.left - wide.left
    planes = planes[:, top : top + area.shape[0], left : left + area.shape[1]]
    return planes[:-1], planes[-1]


def _value(coefficients: Planes, features: Sequence[Floats] | Floats) -> NDArray[np.float64]:
    """Value of polynomials."""
    value = coefficients[0] + coefficients[1] * features[0]
    for slope, feature in zip(coefficients[2 : 1 + FEATURES], features[1:], strict=True):
        value += slope * feature
    return value


def finer(planes: Planes, there: NDArray[np.bool_]) -> Planes:
    """(K, 2 rows, 2 columns) bilinear means of (K, rows, columns) values of those cells that are `there`."""
    weighted = np.concatenate([planes * there, there[None]])
    loop = fit_loop()
    if loop is not None:
        return loop.finer(weighted)
    count, rows, columns = weighted.shape
    down = np.stack(_between(weighted, 1), axis=2).reshape(count, 2 * rows, columns)
    weighted = np.stack(_between(down, 2), axis=3).reshape(count, 2 * rows, 2 * columns)
    return weighted[:-1] / np.maximum(weighted[-1], 1e-30)


def _between(planes: Planes, axis: int) -> tuple[Planes, Planes]:
    """Values a quarter of a cell before and after the centres of cells along an axis; cells outside hold
    nothing."""
    far, size = 0.25 * planes, planes.shape[axis]
    before = 0.75 * planes
    after = before.copy()
    if axis == 1:
        before[:, 1:] += far[:, : size - 1]
        after[:, : size - 1] += far[:, 1:]
    else:
        before[:, :, 1:] += far[:, :, : size - 1]
        after[:, :, : size - 1] += far[:, :, 1:]
    return before, after


def interpolated(coefficients: Planes, features: NDArray[np.float32]) -> NDArray[np.float64]:
    """(4, rows, columns) hidden share of pixels: bilinear means of the polynomials of cells that hold pixels.

    Parameters
    ----------
    coefficients : (8, rows, columns) float64
        From `cell_polynomials`.
    features : (6, 4, rows, columns) float32
    """
    planes = coefficients * coefficients[-1]
    loop = fit_loop()
    if loop is not None:
        return loop.interpolated(planes, features)
    out = np.empty(features.shape[1:])
    for upper, down in enumerate(_between(planes, 1)):
        for left, mean in enumerate(_between(down, 2)):
            value = _value(mean, features[:, 2 * upper + left])
            value /= np.maximum(mean[-1], 1e-30)
            out[2 * upper + left] = value
    return out
