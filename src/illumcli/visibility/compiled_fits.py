"""Moments of cells of pixels and fits in windows of cells by a loop in C (`regression.c`).

It does the operations of `visibility.reconstruction` in their order, without the interpreter's lock and in a
core's first cache: a quarter of the time on one thread.
"""

from __future__ import annotations

import ctypes
from functools import cache

import numpy as np
from numpy.typing import NDArray

from illumcli.compiled import are_switched_off, compiled_library
from illumcli.visibility.regression import Planes

INTERFACE = 1
"""Version of the interface of `regression.c`; a library with another one is not used."""


class _Planes(ctypes.Structure):
    _fields_ = (("data", ctypes.c_void_p), ("plane", ctypes.c_int64), ("row", ctypes.c_int64))


class FitLoop:
    """The compiled loop."""

    def __init__(self, library: ctypes.CDLL) -> None:
        size, planes = ctypes.c_int64, ctypes.POINTER(_Planes)
        self._cell_moments, self._window_fits = library.illum_cell_moments, library.illum_window_fits
        self._cell_moments.argtypes = [ctypes.c_void_p, size, size, planes]
        self._window_fits.argtypes = [planes, size, size, size, planes]
        self._cell_moments.restype = self._window_fits.restype = None

    def cell_moments(self, planes: NDArray[np.float32], out: Planes) -> None:
        """The moments of cells, (36, rows, columns).

        Parameters
        ----------
        planes : (8, 4, rows, columns) float32
            Share, hidden share and features of the pixels of each cell; contiguous.
        """
        assert planes.flags.c_contiguous
        self._cell_moments(planes.ctypes.data, *planes.shape[2:], _planes(out))

    def window_fits(self, cells: Planes, radius: int, out: Planes) -> None:
        """The fits in the window around each cell, (11, rows, columns), as `reconstruction.fit` has them.

        Parameters
        ----------
        cells : (36, rows, columns) float64
            Moments within an array that reaches `radius` cells further on all sides.
        """
        self._window_fits(_planes(cells), radius, *cells.shape[1:], _planes(out))


@cache
def _fit_loop() -> FitLoop | None:
    library = compiled_library(__file__, "regression", INTERFACE)
    return None if library is None else FitLoop(library)


def fit_loop() -> FitLoop | None:
    """The compiled loop, if there is one and it is not switched off."""
    return None if are_switched_off() else _fit_loop()


def _planes(array: Planes) -> _Planes:
    plane, row, column = array.strides
    size = array.itemsize
    assert column == size
    return _Planes(array.ctypes.data, plane // size, row // size)
