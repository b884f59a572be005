"""Measurements of a BRDF as pairs of directions, whatever file they come from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Vectors
from illumcli.errors import InputError
from illumcli.records import Record

STEEPEST = 80.0
"""Light and eye at larger angles to the normal are left out: measurements are unreliable there [degrees]."""


class Measurement(Record):
    """Values of a BRDF at pairs of directions, about the normal z with the grain along x."""

    l: Vectors
    """(N, 3) unit vectors to the light."""
    v: Vectors
    """(N, 3) unit vectors to the eye."""
    values: NDArray[np.float64]
    """(N, 3) the BRDF in R, G, B [1/sr]."""
    weight: NDArray[np.float64]
    """(N,) the share of each pair in a metric; their sum is 1."""
    standard_error: NDArray[np.float64] | None
    """(N, 3) of `values` [1/sr]; None if the file has none."""
    is_isotropic: bool
    """True if the file's format has no azimuth of the surface."""
    about: str
    """How the pairs were chosen."""
    is_noise_common: bool = False
    """True if the channels of a pair have the same noise, from the same rays; otherwise it is independent."""


def read_measurement(path: Path) -> Measurement:
    """The pairs of a measurement below `STEEPEST`, by the suffix of its file.

    Raises
    ------
    InputError
        The file cannot be read, is not what its suffix says, or holds no pair that can be used.
    """
    match path.suffix.lower():
        case ".binary":
            from illumcli.fitting.merl_pairs import merl_pairs

            return merl_pairs(path)
        case ".bsdf":
            from illumcli.fitting.rgl_pairs import rgl_pairs

            return rgl_pairs(path)
        case ".npz":
            from illumcli.fitting.measured_pairs import measured_pairs

            return measured_pairs(path)
        case ".csv":
            from illumcli.fitting.pair_table import read_table

            return read_table(path)
    raise InputError(
        f"{path}: a measurement is a MERL file (.binary), an RGL file (.bsdf), a table of illum measure "
        "(.npz) or of pairs (.csv); let the name end so"
    )


def below_steepest(l: Vectors, v: Vectors) -> NDArray[np.bool_]:
    """(N,) True where light and eye are both within `STEEPEST` degrees of the normal."""
    least = np.cos(np.radians(STEEPEST))
    return (l[:, 2] >= least) & (v[:, 2] >= least)
