"""Evaluators of measured BRDFs: half and difference angles, and cells of the table."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats
from illumcli.measured_files.merl import cell_numbers
from illumcli.models import merl
from illumcli.verification.inputs import Inputs
from illumcli.verification.lobes import computed_terms


def rusinkiewicz(inputs: Inputs) -> Floats:
    """[theta_h, phi_h, theta_d, phi_d] about the tangent."""
    theta_h, theta_d, phi_d = angles(inputs)
    t_s, b_s = computed_terms(inputs, "t_s", "b_s", t=inputs.tangent())
    return np.concatenate([theta_h, np.arctan2(b_s, t_s), theta_d, phi_d])


def rusinkiewicz_theta(inputs: Inputs) -> Floats:
    """[theta_h, theta_d], which are defined even if the azimuths are not."""
    return np.concatenate(angles(inputs)[:2])


def angles(inputs: Inputs) -> tuple[Floats, Floats, Floats]:
    """theta_h, theta_d and phi_d, as the model computes them."""
    return merl.rusinkiewicz(*computed_terms(inputs, "nxs", "n_s", "n", "d", "s_s"))


def merl_index(inputs: Inputs) -> NDArray[Any]:
    """Cell numbers along theta_h, theta_d, phi_d, and in the whole table."""
    return np.concatenate(cell_numbers(*(inputs.scalars(key) for key in ("theta_h", "theta_d", "phi_d"))))


CASES = {f.__name__: f for f in (rusinkiewicz, rusinkiewicz_theta, merl_index)}
