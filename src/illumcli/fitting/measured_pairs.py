"""Pairs of directions from a table of `illum measure`, with the standard errors of its cells."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from illumcli.arrays import column_major
from illumcli.errors import InputError
from illumcli.fitting.measurement import STEEPEST, Measurement, below_steepest
from illumcli.fitting.merl_pairs import Strata, drawn_strata
from illumcli.gonioreflectometer.table import Table, read_table

MOST_PAIRS = 45000
"""Drawn at random from a table of more."""


def measured_pairs(path: Path) -> Measurement:
    """The pairs of a table that `illum measure` wrote as `.npz`.

    Isotropic tables have the cells of MERL, and give the same pairs. Of others pairs of cells are drawn;
    their weight is the product of both solid angles.

    Raises
    ------
    InputError
        The file is no such table, or has no value that can be used.
    """
    table = read_table(path)
    strata = drawn_strata() if table.is_isotropic else _drawn_cells(table)
    values, errors = (
        each.reshape(3, -1)[:, strata.cell].T.astype(np.float64)
        for each in (table.brdf, table.standard_error)
    )
    kept = np.flatnonzero(np.all(np.isfinite(values) & np.isfinite(errors), axis=1))
    if not kept.size:
        raise InputError(f"{path}: no cell below {STEEPEST:g} degrees has a value; measure with more samples")
    weight = strata.weight[kept]
    return Measurement(
        l=column_major(strata.l[kept]),
        v=column_major(strata.v[kept]),
        values=values[kept],
        weight=weight / weight.sum(),
        standard_error=errors[kept],
        is_isotropic=table.is_isotropic,
        about=f"{kept.size} of {table.brdf[0].size} cells below {STEEPEST:g} degrees",
        is_noise_common=True,
    )


def _drawn_cells(table: Table, seed: int = 0) -> Strata:
    """Pairs of cells of a table that is not isotropic."""
    grid = table.grid()
    edges = np.cos(np.linspace(0, np.pi / 2, grid.polar + 1))
    solid_angle = np.repeat(edges[:-1] - edges[1:], grid.around)
    usable = np.flatnonzero(below_steepest(grid.directions, grid.directions))
    light, eye = (each.ravel() for each in np.meshgrid(usable, usable, indexing="ij"))
    if len(light) > MOST_PAIRS:
        drawn = np.sort(np.random.default_rng(seed).choice(len(light), MOST_PAIRS, replace=False))
        light, eye = light[drawn], eye[drawn]
    return Strata(
        cell=light * len(grid) + eye,
        l=grid.directions[light],
        v=grid.directions[eye],
        weight=solid_angle[light] * solid_angle[eye],
    )
