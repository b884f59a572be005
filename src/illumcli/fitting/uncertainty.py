"""Standard errors of fitted parameters, and which parameters the measurement does not determine.

With J the derivatives of the weighted residuals r and A = J^T J, an optimum moves by A^-1 J^T dr when the
data change by dr. So the covariance of the coordinates is

C = A^-1 (sum_i J_i^T S_i J_i) A^-1        over pairs i, J_i of size 3 x P

S_i is the covariance of the three residuals of a pair: from the standard errors of the data if the file
has them, otherwise from the residuals themselves, S_i = e_i e_i^T with e_i = (1 - J_i A^-1 J_i^T)^(-1/2)
r_i. This holds whatever the noise is at each pair and between its channels, if pairs are independent
(White 1980; the root removes the bias of small samples, Bell and McCaffrey 2002). Where the model does
not fit, its misfit counts as noise.

A parameter is not determined if the residuals do not change with it, alone or together with others.

References
----------
White, H. (1980). A heteroskedasticity-consistent covariance matrix estimator. Econometrica 48(4).
Bell, R. M., McCaffrey, D. F. (2002). Bias reduction in standard errors for linear regression with multi-stage
samples. Survey Methodology 28(2).
"""

from __future__ import annotations

import numpy as np

from illumcli.fitting.determinacy import directions_of
from illumcli.fitting.metrics import SLOPES
from illumcli.fitting.problem import Doubles, Problem
from illumcli.fitting.solve import Optimum
from illumcli.records import Record

LOOSE = 0.5
"""A combination whose standard error is larger, as a share of its range or as a factor of e, is loose."""


class Uncertainty(Record):
    """What is known of the parameters at an optimum."""

    standard_error: Doubles
    """(P,) of the values, not of the coordinates; inf where not determined; NaN where it is held, and
    where nothing tells the noise: as many parameters as data, without standard errors."""
    undetermined: tuple[tuple[str, ...], ...]
    """Names of parameters of which only some combination, or nothing, is determined."""
    loose: tuple[tuple[str, ...], ...]
    """Names of parameters of which a combination has a standard error above `LOOSE`."""


def uncertainty(
    problem: Problem, optimum: Optimum, standard_error: Doubles | None, is_noise_common: bool = False
) -> Uncertainty:
    """Standard errors and undetermined parameters.

    Parameters
    ----------
    standard_error : ndarray, optional
        (N, 3) of the data, f_r n.l.
    is_noise_common : bool
        The channels of a pair have the same noise, instead of independent noise.
    """
    free = np.flatnonzero(~optimum.is_held)
    labels = np.array(problem.parameters.labels())[free]
    out = np.full(len(optimum.x), np.nan)
    if not free.size:
        return Uncertainty(out, (), ())
    directions = directions_of(problem, optimum.x, free)
    axes, values = directions.axes[~directions.is_null], directions.values[~directions.is_null]
    null = [directions.members(axis) for axis in directions.axes[directions.is_null]]

    # The covariance within what is determined, and its own axes.
    inverse = (axes.T / np.square(values)) @ axes
    residuals = problem.residuals(optimum.x).reshape(-1, 3)
    spread = _spread(problem, optimum.x, standard_error)
    if spread is None:
        middle = _middle(directions.J, inverse, residuals)
    else:
        middle = _known_middle(directions.J, spread, is_noise_common)
    C = inverse @ middle @ inverse
    variances, combinations = np.linalg.eigh(C)
    loose = [directions.members(axis) for axis in combinations.T[variances > LOOSE**2]]

    # Back to values.
    errors = np.where(directions.undetermined(), np.inf, np.sqrt(np.maximum(np.diag(C), 0)))
    if spread is None and residuals.size <= len(values):
        errors[np.isfinite(errors)] = np.nan  # a model that goes through all data leaves no residuals
    out[free] = errors * directions.unit * slopes(problem, optimum.x)[free]
    undetermined, uncertain = (
        tuple(tuple(labels[members].tolist()) for members in each) for each in (null, loose)
    )
    return Uncertainty(out, undetermined, uncertain)


def slopes(problem: Problem, x: Doubles) -> Doubles:
    """(P,) derivatives of the values by the coordinates."""
    parts = [each.slope(x[place]) for each, place in problem.parameters.slices()]
    return np.concatenate(parts)


def _spread(problem: Problem, x: Doubles, standard_error: Doubles | None) -> Doubles | None:
    """(N, 3) standard errors of the residuals, from those of the data."""
    if standard_error is None:
        return None
    slope = SLOPES[problem.metric](problem.response(x))
    return slope * standard_error * np.sqrt(problem.weight / 3)[:, None]


def _known_middle(J: Doubles, spread: Doubles, is_noise_common: bool) -> Doubles:
    """(P, P) the sum of J_i^T S_i J_i, from the standard errors of the residuals, (N, 3)."""
    scaled = J.reshape(-1, 3, J.shape[1]) * spread[..., None]
    pulled = scaled.sum(axis=1) if is_noise_common else scaled.reshape(J.shape)
    return pulled.T @ pulled


def _middle(J: Doubles, inverse: Doubles, residuals: Doubles) -> Doubles:
    """(P, P) the sum of J_i^T S_i J_i, from the residuals, (N, 3)."""
    blocks = J.reshape(-1, 3, J.shape[1])
    rest = np.eye(3) - np.einsum("ncp,pq,ndq->ncd", blocks, inverse, blocks, optimize=True)
    values, vectors = np.linalg.eigh(rest)
    turned = np.einsum("ncd,nc->nd", vectors, residuals) / np.sqrt(np.maximum(values, 1e-6))
    pulled = np.einsum("ncp,nc->np", blocks, np.einsum("ncd,nd->nc", vectors, turned))
    return pulled.T @ pulled
