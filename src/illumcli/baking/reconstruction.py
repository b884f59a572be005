"""Reconstruction of w at the points of a bake from few rays: local first-order regression on the surface.

The noise of w differs from point to point, w itself follows the surface. So w of a point is taken from a
first-order polynomial of the normal and the position, fitted by least squares to the raw values of the points
around it. Points are grouped into cells; a window is a cell and its nearest cells of the same object whose
normals agree, so that no value crosses a hard edge. The k-th nearest of K cells, counted from 0, has the
weight 1 - k / K. On a surface k grows like the square of the distance, so this is Epanechnikov's kernel,
which has the least error.

Each cell takes the window of the least risk, by Stein's unbiased estimate from the standard errors of the raw
values; where no window promises less than the raw values they stay. Of dense points, as texels are, the
differences between consecutive raw values also tell their errors. The same is done over the cells of
another order of the points, and the mean taken, which smooths the steps between cells.

References
----------
Epanechnikov, V. A. (1969). Non-parametric estimation of a multivariate probability density. Theory of
Probability and Its Applications 14(1).
Fan, J. et al. (1997). Local polynomial regression: optimal kernels and asymptotic minimax efficiency. Annals
of the Institute of Statistical Mathematics 49(1).
Stein, C. M. (1981). Estimation of the mean of a multivariate normal distribution. Annals of Statistics 9(6).
Li, T.-M., Wu, Y.-T. and Chuang, Y.-Y. (2012). SURE-based optimization for adaptive sampling and
reconstruction. ACM Transactions on Graphics 31(6).
Bitterli, B. et al. (2016). Nonlinearly weighted first-order regression for denoising Monte Carlo renderings.
Computer Graphics Forum 35(4). Not followed: its non-linear weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Vectors, column_major, unit
from illumcli.baking.cells import Cells, cells_of
from illumcli.baking.compiled_cells import CellPoints, cell_loop
from illumcli.baking.points import Points
from illumcli.geometry.spatial_order import compact
from illumcli.records import Record
from illumcli.visibility.regression import FEATURES, MOMENTS, Planes, moments, polynomials

WINDOWS = (2, 4, 8, 16)
"""Cells of the windows that polynomials are fitted in: up to 16, 32, 64 and 128 points."""
POOL = 12
"""Nearest cells that a risk is averaged over: one cell's own is too uncertain."""
EXCESS = 2.0
"""Between windows, the variance of a raw value is that of the residuals in the smallest window, but at most
so many times the stated one: where windows are too coarse, residuals are mostly bias."""
ROTATIONS = (None, np.array([[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]]) / 3)
"""Of the positions before they are ordered into cells: one reconstruction each. Without one, cells follow the
order of the points."""
CELLS_AT_ONCE = 1 << 11
"""Cells that are solved together."""


class RawValues(Record):
    """What M points know of w before they are reconstructed."""

    hidden: NDArray[np.float64]  # (M,) 1 - w
    variance: NDArray[np.float64]  # (M,) as stated, 0 where a point is known to be open
    bent: Vectors | None = None  # (M, 3) mean unoccluded directions


class Reconstruction(Record):
    """Reconstructed values of M points."""

    hidden: NDArray[np.float64]  # (M,) 1 - w in [0, 1]; exactly 0 where nothing around is hidden
    risk: NDArray[np.float64]  # (M,) expected square error, by the estimate that chose the windows
    windows: dict[int, float]  # points in a window, at most; 1 for raw values -> share of the cells
    bent: Vectors | None = None  # (M, 3) float32 unit, in the same windows


def rotated_cells(points: Points, threads: int) -> list[Cells]:
    """Cells over the points, ordered anew for each rotation; the same for all values at these points."""
    with ThreadPoolExecutor(threads, thread_name_prefix="cells") as pool:
        return list(pool.map(partial(_rotated_cells, points), ROTATIONS))


def _rotated_cells(points: Points, rotation: NDArray[np.float64] | None) -> Cells:
    position, order = points.position, points.order
    if rotation is not None:
        x, y, z = position.T.astype(np.float64)
        position = column_major(np.stack([x * a + y * b + z * c for a, b, c in rotation], axis=1), F)
        order = compact(position)
    return cells_of(position, points.n, points.objects, order, WINDOWS[-1], points.cell_size)


def reconstruct(points: Points, rotated: Sequence[Cells], raw: RawValues, threads: int) -> Reconstruction:
    """The mean of the reconstructions over each of several sets of cells."""
    if not len(raw.hidden):
        return Reconstruction(raw.hidden, raw.variance, {}, raw.bent)
    features = np.concatenate([points.n.T, points.position.T]).astype(np.float64)
    hidden, risk = np.zeros(len(raw.hidden)), np.zeros(len(raw.hidden))
    bent = None if raw.bent is None else np.zeros((len(raw.hidden), 3), order="F")
    chosen = np.zeros(len(WINDOWS) + 1)
    with ThreadPoolExecutor(threads, thread_name_prefix="reconstruct") as pool:
        for cells in rotated:
            values = CellValues(cells, features, raw, points.is_dense)
            best = chosen_fits(list(pool.map(values.fits, values.blocks())), cells)
            fitted = pool.map(partial(values.fitted, best), values.blocks())
            for block, at_points in zip(values.blocks(), fitted, strict=True):
                is_point = cells.filled[block].T
                index = cells.points[block].T[is_point]
                hidden[index] += at_points.hidden[is_point]
                risk[index] += at_points.risk[is_point]
                if bent is not None and at_points.bent is not None:
                    bent[index] += at_points.bent[:, is_point].T
            chosen += np.bincount(best.window, minlength=len(chosen)) / len(best.window)
    count = len(rotated)
    sizes = (1, *(points.cell_size * each for each in WINDOWS))
    windows = dict(zip(sizes, (chosen / count).tolist(), strict=True))
    directions = None if bent is None else unit(column_major(bent, F))
    return Reconstruction(np.clip(hidden / count, 0, 1), risk / count, windows, directions)


class Fits(Record):
    """Polynomials fitted in the windows of B cells, and what the risk of each is estimated from."""

    coefficients: NDArray[np.float64]  # (windows, 7, B) constant and slopes
    residual: NDArray[np.float64]  # (windows, B) sum of the squared residuals of the cell's points
    leverage: NDArray[np.float64]  # (windows, B) sum of their leverages
    variance: NDArray[np.float64]  # (B,) sum of the stated variances
    noise: NDArray[np.float64]  # (B,) the same, from the residuals of consecutive points; 0 if not dense
    count: NDArray[np.float64]  # (B,) points


class ChosenFits(Record):
    """The window of each cell."""

    window: NDArray[np.int64]  # (C,) 0 where raw values stay
    coefficients: NDArray[np.float64]  # (7, C)
    risk: NDArray[np.float64]  # (C,)


class Fitted(Record):
    """Values at the points of B cells."""

    hidden: NDArray[np.float64]  # (size, B)
    risk: NDArray[np.float64]  # (size, B)
    bent: NDArray[np.float64] | None  # (3, size, B)


class Directions(Record):
    """Mean unoccluded directions, and their moments."""

    bent: Vectors  # (M, 3)
    moments: NDArray[np.float64]  # (C + 1, 3, 7) of each component: sum, and sums of products with features


class CellValues:
    """Raw values and features of the points of each cell, and the moments of cells."""

    def __init__(self, cells: Cells, features: Planes, raw: RawValues, is_dense: bool) -> None:
        self._cells, self._features, self._raw, self._is_dense = cells, features, raw, is_dense
        # moments of every cell, and of an empty one that stands for neighbours that are not there
        self._moments = np.zeros((len(cells.points) + 1, MOMENTS))
        for block in self.blocks():
            self._sum_moments(block)
        self._directions = None if raw.bent is None else self._with_moments(raw.bent)

    def _points(self, block: slice) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """(size, B) points of the cells of a block, and 1 where there is one, else 0."""
        cells = self._cells
        return cells.points[block].T.copy(), cells.filled[block].T.astype(np.float64, order="C")

    def _sum_moments(self, block: slice) -> None:
        loop = cell_loop()
        if loop is not None:
            loop.moments(self._in_c(block), self._moments[block])
            return
        index, share = self._points(block)
        hidden, features = self._raw.hidden[index], self._features[:, index]
        moments(share, hidden, features, _sum_points, self._moments[block].T)

    def _in_c(self, block: slice) -> CellPoints:
        """The points of a block, for the compiled loop."""
        cells = self._cells
        return CellPoints(self._features, self._raw.hidden, cells.points[block], cells.filled[block])

    def _with_moments(self, bent: Vectors) -> Directions:
        out = np.zeros((len(self._cells.points) + 1, 3, 1 + FEATURES))
        for block in self.blocks():
            index, share = self._points(block)
            for axis, component in enumerate(bent.T):
                weighted = share * component[index]
                _sum_points(weighted, out[block, axis, 0])
                for number, feature in enumerate(self._features, 1):
                    _sum_points(weighted * feature[index], out[block, axis, number])
        return Directions(bent, out)

    def blocks(self) -> list[slice]:
        """Cells that are solved together."""
        count = len(self._cells.points)
        return [slice(k, min(k + CELLS_AT_ONCE, count)) for k in range(0, count, CELLS_AT_ONCE)]

    def fits(self, block: slice) -> Fits:
        """The polynomials of a block in each of the windows."""
        (index, share), near = self._points(block), self._cells.near[block]
        count = len(near)
        coefficients = np.empty((len(WINDOWS), 1 + FEATURES, count))
        residual, leverage = (np.empty((len(WINDOWS), count)) for _ in range(2))
        steps = np.empty(count)
        out = coefficients, residual, leverage, steps
        loop = cell_loop()
        if loop is None:
            self._fit_windows(block, out)
        else:
            loop.fits(self._in_c(block), self._moments, near, WINDOWS, out)
        return Fits(
            coefficients,
            residual,
            leverage,
            (share * self._raw.variance[index]).sum(axis=0),
            _noise(steps, share) if self._is_dense else np.zeros(count),
            share.sum(axis=0),
        )

    def _fit_windows(self, block: slice, out: Sequence[NDArray[np.float64]]) -> None:
        """The same as the compiled loop's."""
        coefficients, residual, leverage, steps = out
        (index, share), near = self._points(block), self._cells.near[block]
        hidden, features = self._raw.hidden[index], self._features[:, index]
        # sums over the nearest cells, and the same weighted by how many are nearer
        sums, by_rank = np.zeros((len(near), MOMENTS)), np.zeros((len(near), MOMENTS))
        first = 0
        for number, window in enumerate(WINDOWS):
            for k in range(first, window):
                of_cell = self._moments.take(near[:, k], axis=0)
                sums += of_cell
                by_rank += k * of_cell
            first = window
            of_window = polynomials((sums - by_rank / window).T[:, None].copy())
            coefficients[number] = of_window.coefficients()[:, 0]
            off = of_window.at(features) - hidden
            _sum_points(share * np.square(off), residual[number])
            if number == 0:
                _sum_points(share[1:] * share[:-1] * np.square(np.diff(off, axis=0)), steps)
            _sum_points(share * np.minimum(of_window.leverage(features), 1), leverage[number])

    def fitted(self, best: ChosenFits, block: slice) -> Fitted:
        """The values at the points of a block."""
        (index, _), is_raw = self._points(block), best.window[block] == 0
        value = np.repeat(best.coefficients[:1, block], len(index), axis=0)
        for slope, feature in zip(best.coefficients[1:, block], self._features, strict=True):
            value += slope * feature[index]
        return Fitted(
            np.where(is_raw, self._raw.hidden[index], value),
            np.where(is_raw, self._raw.variance[index], best.risk[block]),
            None if self._directions is None else self._fitted_directions(self._directions, best, block),
        )

    def _fitted_directions(
        self, directions: Directions, best: ChosenFits, block: slice
    ) -> NDArray[np.float64]:
        """(3, size, B) mean unoccluded directions, from polynomials in the windows that were chosen for w."""
        # moments over the cells of each window
        (index, _), near = self._points(block), self._cells.near[block]
        size = np.array([1, *WINDOWS])[best.window[block]]
        sums = np.zeros((len(near), MOMENTS))
        others = np.zeros((len(near), 3, 1 + FEATURES))
        for k in range(WINDOWS[-1]):
            weight = np.maximum(1 - k / size, 0)
            sums += weight[:, None] * self._moments.take(near[:, k], axis=0)
            others += weight[:, None, None] * directions.moments.take(near[:, k], axis=0)

        # polynomials of each component at the points
        features = self._features[:, index]
        of_window = polynomials(sums.T[:, None].copy())
        means = others.transpose(1, 2, 0)[:, :, None] / of_window.count
        fitted = np.stack([of_window.of_another(each[0], each[1:], features) for each in means])
        raw = np.stack([component[index] for component in directions.bent.T])
        return np.where(best.window[block] == 0, raw, fitted)


def chosen_fits(fits: Sequence[Fits], cells: Cells) -> ChosenFits:
    """The window of the least risk of each cell, averaged over the cells around.

    The risk of a fit f to raw values y of variance s^2 is (f - y)^2 + (2 leverage - 1) s^2: it errs by bias
    and noise, and the leverage is the share of its own raw value in f. That of the raw value is s^2.
    """
    # means over the points of the cells around
    count = _pooled(np.concatenate([each.count for each in fits]), cells)
    stated, noise = (
        _pooled(np.concatenate([getattr(each, name) for each in fits]), cells) / count
        for name in ("variance", "noise")
    )
    stated = np.maximum(stated, noise)
    residual = _pooled(np.concatenate([each.residual for each in fits], axis=1), cells) / count
    leverage = _pooled(np.concatenate([each.leverage for each in fits], axis=1), cells) / count

    # the best of the windows
    of_residuals = residual[0] / np.maximum(1 - leverage[0], 0.05)
    variance = np.clip(of_residuals, stated, EXCESS * stated)
    best = np.argmin(residual + (2 * leverage - 1) * variance, axis=0)

    # against the raw value
    at = best[None]
    share = np.take_along_axis(leverage, at, axis=0)[0]
    risk = np.take_along_axis(residual, at, axis=0)[0] + (2 * share - 1) * stated
    coefficients = np.concatenate([each.coefficients for each in fits], axis=2)
    return ChosenFits(
        np.where(risk < stated, best + 1, 0),
        np.take_along_axis(coefficients, best[None, None], axis=0)[0],
        np.maximum(risk, share * stated),
    )


def _pooled(values: NDArray[np.float64], cells: Cells) -> NDArray[np.float64]:
    """(..., C) sums over the cells around each."""
    padded = np.concatenate([values, np.zeros((*values.shape[:-1], 1))], axis=-1)
    out = np.zeros_like(values)
    for near in cells.near.T[:POOL]:
        out += padded.take(near, axis=-1)
    return out


def _noise(steps: NDArray[np.float64], share: NDArray[np.float64]) -> NDArray[np.float64]:
    """(B,) variance of the raw values times their number: half the mean square of the differences between
    consecutive ones, as bias hardly differs between these.

    References
    ----------
    von Neumann, J. (1941). Distribution of the ratio of the mean square successive difference to the
    variance. Annals of Mathematical Statistics 12(4).
    """
    pairs = (share[1:] * share[:-1]).sum(axis=0)
    return np.asarray(share.sum(axis=0) * steps / (2 * np.maximum(pairs, 1)))


def _sum_points(values: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """Sums over the points of each cell, (size, B), one after the other."""
    out[...] = 0
    for of_point in values:
        out += of_point
