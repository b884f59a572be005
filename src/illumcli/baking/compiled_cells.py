"""Cells of points by a loop in C (`cells.c`): the nearest of each, moments, and fits in windows of these.

It does the operations of `baking.cells` and `baking.reconstruction` in their order, without the interpreter's
lock and in a core's first cache.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from illumcli.compiled import compiled_loop, declare
from illumcli.records import Record
from illumcli.visibility.regression import Planes

INTERFACE = 1
"""Version of the interface of `cells.c`; a library with another one is not used."""
MOST_WINDOWS = 8


def _fields(kind: type, *names: str) -> list[tuple[str, type]]:
    return [(name, kind) for name in names]


class _Points(ctypes.Structure):
    _fields_ = (
        *_fields(ctypes.c_void_p, "features", "hidden", "points", "filled"),
        *_fields(ctypes.c_int64, "plane", "size", "cells"),
    )


class _Windows(ctypes.Structure):
    _fields_ = (
        *_fields(ctypes.c_void_p, "moments", "near"),
        *_fields(ctypes.c_int64, "neighbours", "windows"),
        ("sizes", ctypes.c_int64 * MOST_WINDOWS),
        *_fields(ctypes.c_void_p, "coefficients", "residual", "leverage", "steps"),
    )


class _Search(ctypes.Structure):
    _fields_ = (
        *_fields(ctypes.c_void_p, "centre", "normal", "near"),
        *_fields(ctypes.c_int64, "cells", "group", "groups_near", "wanted"),
        *_fields(ctypes.c_float, "agree", "apart"),
    )


class CellPoints(Record):
    """Points of some cells, in contiguous arrays."""

    features: Planes  # (6, M) of all points
    hidden: NDArray[np.float64]  # (M,)
    points: NDArray[np.int64]  # (C, size)
    filled: NDArray[np.bool_]  # (C, size)

    def in_c(self) -> _Points:
        """The same for the loop."""
        data = _addresses(self.features, self.hidden, self.points, self.filled)
        return _Points(*data, len(self.hidden), self.points.shape[1], len(self.points))


class CellSearch(Record):
    """C cells, in groups of consecutive ones, and where the nearest of each are searched."""

    centre: NDArray[np.float32]  # (4, C)
    normal: NDArray[np.float32]  # (3, C) unit
    groups: NDArray[np.int64]  # (G, K) groups in which those of each are searched; -1 for none
    group: int  # cells of a group
    agree: float  # least cosine between the normals
    apart: float  # largest squared distance


class CellLoop:
    """The compiled loop."""

    def __init__(self, library: ctypes.CDLL) -> None:
        points, place, number = ctypes.POINTER(_Points), ctypes.c_void_p, ctypes.c_int64
        declare(
            library,
            point_moments=[points, place],
            point_fits=[points, ctypes.POINTER(_Windows)],
            nearest_cells=[ctypes.POINTER(_Search), number, number, place],
        )
        self._library = library

    def moments(self, of: CellPoints, out: NDArray[np.float64]) -> None:
        """The moments of each cell, (C, 36)."""
        self._library.illum_point_moments(of.in_c(), *_addresses(out))

    def fits(
        self,
        of: CellPoints,
        moments: NDArray[np.float64],
        near: NDArray[np.int64],
        windows: Sequence[int],
        out: Sequence[NDArray[np.float64]],
    ) -> None:
        """The fits in the windows of each cell.

        Parameters
        ----------
        moments : (cells, 36) float64
            Of all cells.
        near : (C, K) int64
            The nearest cells of each.
        windows : sequence of int
            Cells of each window.
        out
            Coefficients, (windows, 7, C), residuals and leverages, (windows, C) each, and sums of squared
            differences of consecutive residuals in the first window, (C,).
        """
        sizes = (ctypes.c_int64 * MOST_WINDOWS)(*windows)
        data = _addresses(moments, near)
        about = _Windows(*data, near.shape[1], len(windows), sizes, *_addresses(*out))
        self._library.illum_point_fits(of.in_c(), about)

    def nearest(self, of: CellSearch, first: int, end: int, out: NDArray[np.int64]) -> None:
        """The nearest cells of those in the groups from `first` to `end`, in rows of `out`, (C, wanted)."""
        data = _addresses(of.centre, of.normal, of.groups)
        sizes = of.centre.shape[1], of.group, of.groups.shape[1], out.shape[1]
        self._library.illum_nearest_cells(
            _Search(*data, *sizes, of.agree, of.apart), first, end, *_addresses(out)
        )


def cell_loop() -> CellLoop | None:
    """The compiled loop, if there is one and it is not switched off."""
    return compiled_loop(CellLoop, __file__, "cells", INTERFACE)


def _addresses(*arrays: NDArray[np.generic]) -> list[int]:
    assert all(array.flags.c_contiguous for array in arrays)
    return [array.ctypes.data for array in arrays]
