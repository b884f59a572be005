"""A fit of one model to a measurement, and what is known of it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from illumcli.errors import InputError
from illumcli.fitting.material import material_of
from illumcli.fitting.measurement import Measurement
from illumcli.fitting.metrics import TRANSFORMS, distance
from illumcli.fitting.parameters import Parameters, parameters_of
from illumcli.fitting.problem import problem_of
from illumcli.fitting.solve import Optimum, solve
from illumcli.fitting.uncertainty import Uncertainty, uncertainty
from illumcli.models._base import IlluminationModel
from illumcli.progress import Progress, no_progress
from illumcli.records import Record

SCIPY = "fits need scipy; install it: pip install 'illumcli[fit]'"


class Fit(Record):
    """A fitted model."""

    model: IlluminationModel
    """With the fitted parameters, rounded as in `material`."""
    material: Mapping[str, Any]
    """The keys of the model as a scene has them."""
    parameters: Parameters
    metric: str
    """The metric that was minimised."""
    optimum: Optimum
    uncertainty: Uncertainty
    distances: Mapping[str, float]
    """Metric -> distance of model and measurement."""
    sizes: Mapping[str, float]
    """Metric -> distance of black and measurement."""
    chi_squared: float | None
    """Mean square of the differences over the standard errors of the data, where these are above 0; None if
    the file has none."""


def fit_model(
    model: IlluminationModel,
    measurement: Measurement,
    metric: str = "cosine",
    progress: Progress = no_progress,
) -> Fit:
    """Fit those parameters of a model that were not given.

    Raises
    ------
    InputError
        scipy is not installed; the model has no parameter to fit.
    """
    try:
        import scipy.optimize  # noqa: F401
    except ImportError:
        raise InputError(SCIPY) from None
    parameters = parameters_of(model, measurement.is_isotropic)
    problem = problem_of(model, parameters, metric, measurement)
    optimum = solve(problem, progress)
    errors = measurement.standard_error
    errors = None if errors is None else errors * measurement.l[:, 2:]
    known = uncertainty(problem, optimum, errors, measurement.is_noise_common)

    # The distances at the parameters as they are shown.
    material = material_of(model, parameters, optimum.x, known.standard_error)
    fitted = type(model).model_validate(material)
    response, black = problem.responder.response(fitted), np.zeros_like(problem.data)
    distances, sizes = (
        {name: distance(name, each, problem.data, problem.weight) for name in TRANSFORMS}
        for each in (response, black)
    )
    chi_squared = None
    if errors is not None:
        known_error = errors > 0
        chi_squared = float(np.mean(np.square((response - problem.data)[known_error] / errors[known_error])))
    return Fit(fitted, material, parameters, metric, optimum, known, distances, sizes, chi_squared)
