"""Pairs of directions from a MERL table: one cell from each stratum of theta_h, theta_d and phi_d.

The strata are rows of theta_h, which the format crowds near the highlight, times `THETA_D` by `PHI_D`
blocks of the other two angles; each gives one of its cells, drawn by random numbers of a fixed seed. A
cell represents the pairs of directions of its whole stratum. With h and d the half and the difference
vector

    d omega_l d omega_v = 4 cos(theta_d) d omega_h d omega_d

so its weight is proportional to sin(theta_h) dtheta_h sin(theta_d) cos(theta_d): the correction by solid
angle of Ngan et al., for whole cells. The half vector's azimuth, of which the format has none, is drawn
too, and so is which of the two directions is the light.

References
----------
Ngan, A., Durand, F., Matusik, W. (2005). Experimental analysis of BRDF models. EGSR '05, section 3.
Rusinkiewicz, S. (1998). A new change of variables for efficient BRDF representation. EGWR '98.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Vectors, column_major
from illumcli.errors import InputError
from illumcli.fitting.measurement import STEEPEST, Measurement, below_steepest
from illumcli.gonioreflectometer.directions import turned
from illumcli.measured_files import merl
from illumcli.measured_files.merl import CELLS, SCALE, SHAPE
from illumcli.records import Record

THETA_D, PHI_D = 45, 18
"""Strata along theta_d and phi_d."""


class Strata(Record):
    """One pair of directions per stratum."""

    cell: NDArray[np.int64]
    """(N,) number of the cell in the flat table."""
    l: Vectors
    """(N, 3) unit vectors to the light."""
    v: Vectors
    """(N, 3) unit vectors to the eye."""
    weight: NDArray[np.float64]
    """(N,) proportional to the measure of the stratum."""


def merl_pairs(path: Path) -> Measurement:
    """The pairs of a MERL file that were measured, below `STEEPEST`.

    Raises
    ------
    InputError
        The file is not a MERL measurement, or has no cell that can be used.
    """
    strata = drawn_strata()
    cells = merl.values(merl.mapped(str(path)), strata.cell)
    kept = np.flatnonzero(np.all(cells >= 0, axis=0) & np.all(np.isfinite(cells), axis=0))
    if not kept.size:
        raise InputError(f"{path}: no cell below {STEEPEST:g} degrees has a measurement in R, G and B")
    weight = strata.weight[kept]
    return Measurement(
        l=column_major(strata.l[kept]),
        v=column_major(strata.v[kept]),
        values=(cells[:, kept] * np.array(SCALE)[:, None]).T,
        weight=weight / weight.sum(),
        standard_error=None,
        is_isotropic=True,
        about=f"{kept.size} of {CELLS} cells, one of each stratum below {STEEPEST:g} degrees",
    )


def drawn_strata(seed: int = 0) -> Strata:
    """A cell of each stratum, without those where light or eye is above `STEEPEST`."""
    # Draw a cell of each stratum, the azimuth of its half vector, and which direction is the light.
    random = np.random.default_rng(seed)
    i, j, k = (each.ravel() for each in np.indices((SHAPE[0], THETA_D, PHI_D)))
    j = j * (SHAPE[1] // THETA_D) + random.integers(SHAPE[1] // THETA_D, size=j.size)
    k = k * (SHAPE[2] // PHI_D) + random.integers(SHAPE[2] // PHI_D, size=k.size)
    turn = 2 * np.pi * random.random(i.size)
    phi_d = np.radians(k + 0.5) + np.pi * random.integers(2, size=i.size)

    # The directions at the centre of the cell, and the measure of the stratum.
    theta_h, theta_d = ((i + 0.5) / 90) ** 2 * (np.pi / 2), np.radians(j + 0.5)
    l, v = (turned(each, turn) for each in merl.directions(theta_h, theta_d, phi_d))
    edges = np.cos((np.arange(91) / 90) ** 2 * (np.pi / 2))
    weight = (edges[i] - edges[i + 1]) * np.sin(2 * theta_d)
    kept = np.flatnonzero(below_steepest(l, v))
    flat = (i * SHAPE[1] + j) * SHAPE[2] + k
    return Strata(flat[kept], l[kept], v[kept], weight[kept])
