"""Moments of cells of pixels, fits in windows of cells and values between cells by a loop in C
(`regression.c`).

It does the operations of `visibility.reconstruction` in their order, without the interpreter's lock and in a
core's first cache: a quarter of the time on one thread.
"""

from __future__ import annotations

import ctypes

import numpy as np
from numpy.typing import NDArray

from illumcli.compiled import compiled_loop, declare
from illumcli.visibility.regression import Planes

INTERFACE = 2
"""Version of the interface of `regression.c`; a library with another one is not used."""


class _Planes(ctypes.Structure):
    _fields_ = (("data", ctypes.c_void_p), ("plane", ctypes.c_int64), ("row", ctypes.c_int64))


class _Weighted(ctypes.Structure):
    _fields_ = (("planes", _Planes), *((name, ctypes.c_int64) for name in ("number", "rows", "columns")))


class FitLoop:
    """The compiled loop."""

    def __init__(self, library: ctypes.CDLL) -> None:
        size, planes = ctypes.c_int64, ctypes.POINTER(_Planes)
        weighted = ctypes.POINTER(_Weighted)
        declare(
            library,
            cell_moments=[ctypes.c_void_p, size, size, planes],
            sum_cells=[planes, size, size, planes],
            window_fits=[planes, size, size, size, planes],
            finer=[weighted, planes],
            interpolated=[weighted, ctypes.c_void_p, planes],
        )
        self._library = library

    def cell_moments(self, planes: NDArray[np.float32], out: Planes) -> None:
        """The moments of cells, (36, rows, columns).

        Parameters
        ----------
        planes : (8, 4, rows, columns) float32
            Share, hidden share and features of the pixels of each cell; contiguous.
        """
        assert planes.flags.c_contiguous
        assert planes.dtype == np.float32
        self._library.illum_cell_moments(planes.ctypes.data, *planes.shape[2:], _planes(out))

    def sum_cells(self, cells: Planes, out: Planes) -> None:
        """Sums over 2 x 2 cells: of (36, 2 rows, 2 columns) moments into (36, rows, columns)."""
        self._library.illum_sum_cells(_planes(cells), *out.shape[1:], _planes(out))

    def window_fits(self, cells: Planes, radius: int, out: Planes) -> None:
        """The fits in the window around each cell, (11, rows, columns), as `reconstruction.fit` has them.

        Parameters
        ----------
        cells : (36, rows, columns) float64
            Moments within an array that reaches `radius` cells further on all sides.
        """
        self._library.illum_window_fits(_planes(cells), radius, *cells.shape[1:], _planes(out))

    def finer(self, weighted: Planes) -> Planes:
        """(K, 2 rows, 2 columns) bilinear means of (K + 1, rows, columns) values, the last of which is the
        weight of each cell that the others were multiplied by.
        """
        number, rows, columns = weighted.shape
        out = np.empty((number - 1, 2 * rows, 2 * columns))
        self._library.illum_finer(_weighted(weighted), _planes(out))
        return out

    def interpolated(self, weighted: Planes, features: NDArray[np.float32]) -> Planes:
        """(4, rows, columns) values of polynomials, as `reconstruction.interpolated` has them.

        Parameters
        ----------
        weighted : (8, rows, columns) float64
            Coefficients, multiplied by the weight of each cell, and the weight.
        features : (6, 4, rows, columns) float32
        """
        out = np.empty(features.shape[1:])
        features = np.ascontiguousarray(features, np.float32)
        self._library.illum_interpolated(_weighted(weighted), features.ctypes.data, _planes(out))
        return out


def fit_loop() -> FitLoop | None:
    """The compiled loop, if there is one and it is not switched off."""
    return compiled_loop(FitLoop, __file__, "regression", INTERFACE)


def _planes(array: Planes) -> _Planes:
    plane, row, column = array.strides
    size = array.itemsize
    assert array.dtype == np.float64
    assert column == size
    return _Planes(array.ctypes.data, plane // size, row // size)


def _weighted(array: Planes) -> _Weighted:
    return _Weighted(_planes(array), *array.shape)
