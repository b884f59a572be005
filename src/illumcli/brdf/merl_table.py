"""An isotropic model as a MERL `.binary` table: its BRDF at the centres of the cells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import column_major
from illumcli.brdf.views import Look, values
from illumcli.measured_files import merl

RECIPROCAL = 1e-6
"""Largest difference of light and eye exchanged that is rounding, relative to the value."""


class MerlTable(NamedTuple):
    """A BRDF in the cells of MERL."""

    values: NDArray[np.float64]
    """(3, 90, 90, 180) [1/sr], NaN where light or eye is below the horizon."""
    is_reciprocal: bool
    """False if the values are means of light and eye exchanged, which differ."""


def merl_table(model: Look) -> MerlTable:
    """The table of a model whose look has no grain.

    A cell holds both orders of light and eye, so its value is the mean of both.
    """
    table = np.full((3, *merl.SHAPE), np.nan)
    is_reciprocal = True
    for row in range(merl.SHAPE[0]):
        l, v = merl.cell_directions(row)
        above = np.flatnonzero((l[:, 2] > 0) & (v[:, 2] > 0))
        l, v = column_major(l[above]), column_major(v[above])
        n, t = (np.broadcast_to(np.array(axis), l.shape) for axis in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)))
        there, back = (values(model, n, *order, t, times_cos=False) for order in ((l, v), (v, l)))
        is_reciprocal &= bool((np.abs(there - back) <= RECIPROCAL * (there + back)).all())
        table[:, row].reshape(3, -1)[:, above] = (there + back).T / 2
    return MerlTable(table, is_reciprocal)
