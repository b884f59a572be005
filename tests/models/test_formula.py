"""Formulas as models: other models written as formulas, what varies, what is refused and what is counted."""

from __future__ import annotations

import inspect
from collections import Counter

import numpy as np
import pytest
from pydantic import ValidationError

from illumcli.arrays import column_major
from illumcli.models.blinn_phong import BlinnPhong
from illumcli.models.formula import OF_GRAIN, SCALARS, FormulaModel
from illumcli.models.lambert import Lambert
from illumcli.models.phong import Phong
from illumcli.models.ward import Ward
from illumcli.scene.faults import faults
from illumcli.shading.terms import TERMS, evaluate, given_terms
from illumcli.verification.claims import directions, response


def formula(response, specular=None, **parameters):
    keys = {"model": "formula", "response": response, "parameters": parameters}
    return FormulaModel.model_validate(keys | ({"specular": specular} if specular else {}))


def facts_of(**keys):
    """Path and text of every fault."""
    try:
        FormulaModel.model_validate({"model": "formula", **keys})
    except ValidationError as error:
        return [
            (".".join(map(str, path)), fact)
            for path, fact in faults(error, FormulaModel, {"model": "formula", **keys})
        ]
    return []


def test_the_terms_are_numbers_and_those_of_the_grain_are_known():
    returned = {name: inspect.get_annotations(TERMS[name].function)["return"] for name in SCALARS}
    assert set(returned.values()) == {"Floats"}
    assert {name for name in SCALARS if "t" in given_terms(formula(name).lobes())} == OF_GRAIN


def test_the_page_names_every_term():
    page = inspect.getmodule(FormulaModel).__doc__
    assert all(name in page for name in SCALARS)


@pytest.mark.parametrize(
    ("own", "known"),
    [
        (formula("n_l * kd / pi", kd=[0.2, 0.5, 0.8]), Lambert(diffuse=(0.2, 0.5, 0.8))),
        (
            formula("n_l * kd", "ks * max(0, 1 - gap_rv)**m", kd=0.5, ks=[0.3, 0.2, 0.1], m=20.0),
            Phong(diffuse=(0.5,) * 3, specular=(0.3, 0.2, 0.1), exponent=20.0),
        ),
        (
            formula("n_l * kd", "ks * n_h**m", kd=0.5, ks=0.3, m=20),
            BlinnPhong(diffuse=(0.5,) * 3, specular=(0.3,) * 3, exponent=20.0),
        ),
        (
            formula(
                "n_l * kd / pi",
                "ks * sqrt(n_l / n_v) / (4*pi*ax*ay) * exp(-((t_s/ax)**2 + (b_s/ay)**2) / n_s**2)",
                kd=0.4,
                ks=0.2,
                ax=0.15,
                ay=0.5,
            ),
            Ward(diffuse=(0.4,) * 3, specular=(0.2,) * 3, alpha_x=0.15, alpha_y=0.5, form="ward"),
        ),
    ],
    ids=["lambert", "phong", "blinn_phong", "ward"],
)
def test_models_of_the_package_as_formulas(own, known):
    given = directions(3, 400, least=0.01)
    np.testing.assert_allclose(response(own, given), response(known, given), rtol=1e-9, atol=1e-13)


def test_two_formulas_are_two_lobes():
    assert list(formula("n_l").lobes()) == ["diffuse"]
    assert list(formula("n_l", "n_h").lobes()) == ["diffuse", "specular"]


def test_a_float32_picture_has_the_formula_in_double_precision():
    """(1 + x) - 1 cancels in single precision."""
    given = {
        "n": column_major([[0, 0, 1]], np.float32),
        "l": column_major([[0.6, 0, 0.8]], np.float32),
        "v": column_major([[0, 0, 1]], np.float32),
    }
    value = response(formula("(1e7 + n_l) - 1e7"), given)
    assert value.dtype == np.float32
    assert value[0, 0] == pytest.approx(0.8, rel=1e-6)


def test_parameters_vary_over_points():
    model = formula("n_l * kd", kd={"vertex": "color"})
    assert list(model.varying()) == ["parameters.kd"]
    given = directions(1, 40)
    colors = column_major(np.random.default_rng(2).random((len(given["l"]), 3)))
    there = response(model.at({"parameters.kd": colors}), given)
    n_l = np.einsum("ij,ij->i", given["n"], given["l"])
    np.testing.assert_allclose(there, colors * n_l[:, None], rtol=1e-14)


def test_the_parameter_diffuse_reflects_ambient_light():
    assert formula("n_l * diffuse", diffuse=0.5).ambient_color() == (0.5, 0.5, 0.5)
    assert formula("n_l", diffuse=0.5).ambient_color() == (0.5, 0.5, 0.5)  # for ambient light alone
    assert formula("n_l * kd", kd=0.5).ambient_color() == (0.0, 0.0, 0.0)


def test_terms_of_the_tangent_are_grain():
    assert formula("n_l * t_l").has_grain()
    assert formula("n_l", "b_s*b_s").has_grain()
    assert not formula("n_l").has_grain()


@pytest.mark.parametrize("text", ["log(n_l - 2)", "1 / (n_l - n_l)", "-n_l", "1e300 * n_l * 1e10"])
def test_values_that_are_no_light_are_0_and_counted(text):
    given, mended = directions(1, 50, np.float32), Counter()
    values = evaluate(formula(text).lobes(), given, mended)["diffuse"]
    assert not values.any()
    assert mended == {"diffuse": values.size}


def test_rounding_of_terms_is_not_counted():
    """On the normal the cosine of float32 is above 1: a root of 1 - n_v would be of a negative number."""
    n = column_major(np.random.default_rng(1).normal(size=(3000, 3)))
    n = column_major((n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32))
    assert (np.einsum("ij,ij->i", n, n) > 1).any()
    t = column_major(np.cross(n, np.roll(n, 1, axis=1)))
    t = column_major((t / np.linalg.norm(t, axis=1, keepdims=True)).astype(np.float32))
    mended = Counter()
    for name, (low, high) in SCALARS.items():
        both = formula(f"sqrt({name} - ({low})) + sqrt({high} - {name})")
        evaluate(both.lobes(), {"n": n, "l": n, "v": n, "t": t}, mended)
    assert not mended


@pytest.mark.parametrize(
    ("keys", "path", "fact"),
    [
        ({}, "", "missing key 'response'"),
        ({"response": "n_l * kd"}, "response", "unknown name 'kd'; there are: n_l"),
        ({"response": "n_w"}, "response", "position 1: unknown name 'n_w'; did you mean 'n_v'?"),
        ({"response": "n * l"}, "response", "unknown name 'n'"),
        ({"response": "light"}, "response", "unknown name 'light'"),
        ({"response": "n_l", "parameters": {"rim": 1}}, "parameters.rim", "is in no formula"),
        ({"response": "rim", "parameters": {"rim": 1, "rmi": 1}}, "parameters.rmi", "did you mean 'rim'?"),
        ({"response": "n_l", "parameters": {"n_l": 1}}, "parameters.n_l", "'n_l' is a term"),
        ({"response": "n_l", "parameters": {"pi": 1}}, "parameters.pi", "'pi' is a term, constant"),
        (
            {"response": "lambda * n_l", "parameters": {"lambda": 1}},
            "parameters.lambda",
            "'lambda' is a reserved word; choose another name, such as lambda_",
        ),
        ({"response": "n_l", "parameters": {"k-d": 1}}, "parameters.k-d", "use letters, digits and _"),
        ({"response": "kd", "parameters": {"kd": "red"}}, "parameters.kd", "is text 'red'"),
        ({"response": "kd", "parameters": {"kd": [1, 2]}}, "parameters.kd", "is a list of 2"),
        ({"response": "n_l.__class__"}, "response", "not part of a formula"),
        ({"response": "open(n_l)"}, "response", "unknown function 'open'"),
        ({"response": "n_l" + "+n_l" * 400}, "response", "at most 1000 characters"),
        ({"response": "-" * 200 + "n_l"}, "response", "nested more than 100 deep"),
        ({"response": 3}, "response", "must be text"),
        ({"response": "n_l", "claims": ["physical"]}, "claims.0", "no choice 'physical'"),
        ({"response": "n_l", "respnse": ""}, "", "unknown key 'respnse'; did you mean 'response'?"),
    ],
)
def test_faults_are_named(keys, path, fact):
    assert any(where.startswith(path) and fact in what for where, what in facts_of(**keys)), facts_of(**keys)
