"""What a measurement does not determine is said, and what ends at a limit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fitting.recovery import asked, measured
from illumcli.brdf import described
from illumcli.errors import InputError
from illumcli.fitting.fit import fit_model
from illumcli.fitting.linear import linear_places
from illumcli.fitting.lobes import with_lobes
from illumcli.fitting.parameters import parameters_of
from illumcli.fitting.problem import problem_of
from illumcli.fitting.report import notes, report
from illumcli.fitting.responder import Responder


def only(name, *overrides):
    (model,) = described([name], overrides).values()
    return model


def of_model(model, count=300):
    """A measurement without noise of a model, at the pairs of a case."""
    pairs = measured("ward", count, 0)
    values = Responder(pairs.l, pairs.v).response(model) / pairs.l[:, 2:]
    return replace(pairs, values=values, standard_error=None)


def test_the_width_of_a_highlight_that_is_absent_is_not_determined():
    fit = fit_model(only("ward"), of_model(only("lambert", "diffuse=[.3, .2, .1]")))
    assert fit.model.diffuse == pytest.approx((0.3, 0.2, 0.1), abs=1e-6)
    assert fit.model.specular == (0, 0, 0)
    assert set(fit.uncertainty.undetermined) == {("alpha_x",), ("alpha_y",)}
    lines = notes(fit)
    assert any(line.startswith("alpha_x is not determined") for line in lines)
    assert any(line.startswith("specular.R is at the end of its range") for line in lines)
    assert "not determined" in report(fit)


def test_weights_of_lafortune_have_a_common_scale():
    truth = only("lafortune", "cx=-0.8", "cy=-0.7", "cz=0.6", "specular=0.3", "exponent=12")
    fit = fit_model(only("lafortune"), of_model(truth))
    chosen = np.array(fit.parameters.labels())[fit.optimum.chosen].tolist()
    assert chosen == ["cx"]
    assert fit.model.cx == -1
    assert fit.model.cz == pytest.approx(0.75, rel=1e-4)
    assert fit.model.exponent == pytest.approx(12, rel=1e-4)
    assert fit.model.specular[0] == pytest.approx(0.3 * 0.8**12, rel=1e-3)
    assert not fit.uncertainty.undetermined
    assert np.all(np.isfinite(fit.uncertainty.standard_error[~fit.optimum.is_held]))


def test_without_grain_both_widths_are_one_parameter():
    for name, second, first in (
        ("ward", "alpha_y", "alpha_x"),
        ("ashikhmin_shirley", "exponent_v", "exponent_u"),
        ("lafortune", "cy", "cx"),
    ):
        assert parameters_of(only(name), True).equal == {second: first}
        assert parameters_of(only(name), False).equal == {}
    two = parameters_of(with_lobes(only("lafortune"), 2), True)
    assert two.equal == {"cy": "cx", "further.0.cy": "further.0.cx"}


def test_given_parameters_are_not_fitted():
    model = only("cook_torrance", "diffuse=0.2", "distribution={D: ggx}", "fresnel={F: dielectric, ior: 1.4}")
    assert parameters_of(model, False).labels() == ["specular_weight", "distribution.alpha"]
    with pytest.raises(InputError, match="lambert: has no parameter to fit"):
        parameters_of(only("lambert", "diffuse=0.2"), False)


def test_linear_parameters_are_found_by_trying():
    wanted = {
        "ward": {"diffuse.R", "diffuse.G", "diffuse.B", "specular.R", "specular.G", "specular.B"},
        "oren_nayar": set(),
        "cook_torrance, ggx": {"diffuse.R", "diffuse.G", "diffuse.B"},
    }
    for case, labels in wanted.items():
        model = only("oren_nayar") if case.startswith("oren") else asked(case)
        parameters = parameters_of(model, False)
        problem = problem_of(model, parameters, "cosine", measured("ward", 300, 0))
        assert {parameters.labels()[place] for place in linear_places(problem)} == labels


def test_two_lobes_are_told_apart():
    truth = only(
        "lafortune",
        "specular=0.6",
        "cx=-1.0",
        "cy=-1.0",
        "cz=1.0",
        "exponent=60",
        "further=[{specular: 0.1, cx: -1.0, cy: -1.0, cz: 1.0, exponent: 6}]",
    )
    model = with_lobes(only("lafortune", "cz=1.0", "further=[{cz: 1.0}]"), 2)
    fit = fit_model(model, replace(of_model(truth), is_isotropic=True))
    found = sorted([fit.model.exponent, fit.model.further[0].exponent])
    assert found == pytest.approx([6, 60], rel=1e-3)


def test_models_of_one_lobe_refuse_two():
    with pytest.raises(InputError, match=r"ward: has one specular lobe.*models with several: lafortune"):
        with_lobes(only("ward"), 2)


def test_as_many_parameters_as_data_leave_the_noise_unknown():
    pairs = of_model(only("lambert", "diffuse=0.3"))
    one = replace(pairs, l=pairs.l[:1], v=pairs.v[:1], values=pairs.values[:1], weight=np.ones(1))
    fit = fit_model(only("lambert"), one)
    assert np.all(np.isnan(fit.uncertainty.standard_error))
    assert "diffuse.R  0.3    unknown" in report(fit)
    assert any(line.endswith("no standard error is known") for line in notes(fit))
    fit = fit_model(only("lambert"), replace(one, standard_error=np.full((1, 3), 0.01)))
    assert fit.uncertainty.standard_error == pytest.approx(np.full(3, 0.01 * np.pi))


def test_derivatives_by_very_large_parameters_are_numbers():
    model, pairs = only("phong"), of_model(only("lambert"))
    parameters = parameters_of(model, False)
    _, high = parameters.limits()
    problem = problem_of(model, parameters, "cosine", pairs)
    assert high.max() == 1e18
    for x in (np.minimum(high, 1e17), high):
        assert np.all(np.isfinite(problem.jacobian(x)))


def test_common_noise_of_the_channels_counts_once():
    """Three channels of one noise tell no more than one of a model that is grey."""
    pairs = measured("oren_nayar", 400, 0)
    ratios = {}
    for common in (False, True):
        fit = fit_model(only("oren_nayar"), replace(pairs, is_noise_common=common))
        ratios[common] = fit.uncertainty.standard_error[-1]
    assert 1.4 < ratios[True] / ratios[False] < 3**0.5 + 1e-9


def test_highlights_far_narrower_than_the_default_are_found():
    truth = only("ashikhmin_shirley", "exponent_u=3e4", "exponent_v=3e4", "specular=0.4")
    pairs = replace(of_model(truth, 1000), is_isotropic=True)
    fit = fit_model(only("ashikhmin_shirley"), pairs, "log")
    assert fit.model.exponent_u == pytest.approx(3e4, rel=1e-3)
