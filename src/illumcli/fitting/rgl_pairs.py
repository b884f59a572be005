"""Pairs of directions from an RGL file: looked up at the directions of `merl_pairs`.

The file's grid follows the highlight, and values between its points are interpolated as in pictures: the
pairs are more than were measured, and not independent of each other.
"""

from __future__ import annotations

from pathlib import Path

from illumcli.fitting.measurement import STEEPEST, Measurement
from illumcli.fitting.merl_pairs import drawn_strata
from illumcli.fitting.responder import Responder
from illumcli.models.rgl import Rgl


def rgl_pairs(path: Path) -> Measurement:
    """The pairs of an RGL file.

    Raises
    ------
    InputError
        The file is not a measurement that can be read.
    """
    strata = drawn_strata()
    response = Responder(strata.l, strata.v).response(Rgl(file=str(path)))
    return Measurement(
        l=strata.l,
        v=strata.v,
        values=response / strata.l[:, 2:],
        weight=strata.weight / strata.weight.sum(),
        standard_error=None,
        is_isotropic=True,
        about=f"{len(response)} pairs, looked up at one of each stratum below {STEEPEST:g} degrees",
    )
