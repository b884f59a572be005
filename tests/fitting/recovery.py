"""Synthetic measurements of known models, and how far fits to them are from the truth in standard errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from illumcli.brdf import described
from illumcli.fitting.fit import fit_model
from illumcli.fitting.measurement import Measurement
from illumcli.fitting.merl_pairs import drawn_strata
from illumcli.fitting.parameters import parameters_of, value_at
from illumcli.fitting.problem import problem_of
from illumcli.fitting.responder import Responder
from illumcli.fitting.solve import Optimum, within_limits
from illumcli.fitting.uncertainty import slopes, uncertainty

RELATIVE, ABSOLUTE = 0.05, 0.002
"""The noise: a share of f_r n.l, and the same for all [1/sr]; normal, independent."""
CASES = {
    "ward": ("ward", ["diffuse=[.3,.2,.1]", "specular=[.1,.12,.08]", "alpha_x=.15", "alpha_y=.3"], []),
    "ward, isotropic": (
        "ward",
        ["diffuse=[.3,.2,.1]", "specular=[.1,.12,.08]", "alpha_x=.2", "alpha_y=.2"],
        [],
    ),
    "cook_torrance, beckmann": (
        "cook_torrance",
        ["diffuse=[.3,.2,.1]", "specular_weight=.4", "distribution.m=.2"],
        ["distribution={D: beckmann}", "fresnel={F: dielectric, ior: 1.5}"],
    ),
    "cook_torrance, ggx": (
        "cook_torrance",
        ["diffuse=[.3,.2,.1]", "specular_weight=.4", "distribution.alpha=.2"],
        ["distribution={D: ggx}"],
    ),
    "cook_torrance, ggx, smith_correlated": (
        "cook_torrance",
        ["diffuse=[.3,.2,.1]", "specular_weight=.4", "distribution.alpha=.2"],
        ["distribution={D: ggx}", "masking=smith_correlated"],
    ),
    "blinn_phong, normalised": (
        "blinn_phong",
        ["diffuse=[.3,.2,.1]", "specular=[.1,.2,.3]", "exponent=60"],
        ["normalised=true"],
    ),
    "lafortune": (
        "lafortune",
        ["diffuse=[.3,.2,.1]", "specular=[.1,.2,.3]", "cx=-1.0", "cy=-.85", "cz=.9", "exponent=20"],
        [],
    ),
    "oren_nayar": ("oren_nayar", ["diffuse=[.3,.2,.1]", "sigma=.4"], []),
    "ashikhmin_shirley": (
        "ashikhmin_shirley",
        ["diffuse=[.3,.2,.1]", "specular=[.1,.2,.3]", "exponent_u=100", "exponent_v=10"],
        [],
    ),
}
"""Name -> model, parameters that are to be found, parameters that are given."""


def truth_of(case):
    """The model of a case, with its true parameters."""
    name, found, given = CASES[case]
    (model,) = described([name], [*given, *found]).values()
    return model


def asked(case):
    """The model of a case, with only those parameters that are given."""
    name, _, given = CASES[case]
    (model,) = described([name], given).values()
    return model


def measured(case, count, seed, level=1.0):
    """A noisy measurement with its standard errors, at pairs that do not depend on the seed."""
    strata = drawn_strata(1)
    rows = np.sort(np.random.default_rng(1).choice(len(strata.cell), count, replace=False))
    l, v, weight = strata.l[rows], strata.v[rows], strata.weight[rows]
    clean = Responder(l, v).response(truth_of(case))
    error = level * (RELATIVE * clean + ABSOLUTE)
    noisy = clean + error * np.random.default_rng((2, seed)).normal(size=clean.shape)
    return Measurement(
        l, v, noisy / l[:, 2:], weight / weight.sum(), error / l[:, 2:], case.endswith("isotropic"), ""
    )


def fitted(case, count=2000, seed=0, metric="cosine", with_errors=True, level=1.0):
    """A fit from all its starts, and the deviations of its parameters in standard errors."""
    measurement = measured(case, count, seed, level)
    if not with_errors:
        measurement = replace(measurement, standard_error=None)
    fit = fit_model(asked(case), measurement, metric)
    x, true = fit.optimum.x, truth_of(case)
    values = np.concatenate([each.value(x[place]) for each, place in fit.parameters.slices()])
    wanted = np.concatenate([np.ravel(value_at(true, each.path)) for each in fit.parameters.free])
    free = ~fit.optimum.is_held
    return fit, ((values - wanted) / fit.uncertainty.standard_error)[free]


def z_scores(case, seeds, count=2000, metric="cosine", with_errors=True):
    """(S, P) deviations of the optimum next to the truth, in standard errors."""
    out = []
    for seed in seeds:
        measurement = measured(case, count, seed)
        parameters = parameters_of(asked(case), measurement.is_isotropic)
        problem = problem_of(asked(case), parameters, metric, measurement)
        true = parameters.coordinates(truth_of(case))
        held = np.array([case == "lafortune" and label == "cx" for label in parameters.labels()])
        x, held = within_limits(problem, true, held)
        errors = measurement.standard_error * measurement.l[:, 2:] if with_errors else None
        known = uncertainty(problem, Optimum(x, held, np.zeros_like(held), 1, 1), errors)
        out.append(((x - true) * slopes(problem, x) / known.standard_error)[~held])
    return np.array(out)
