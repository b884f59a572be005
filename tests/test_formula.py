from __future__ import annotations

import json
import lzma
from importlib.resources import files

import numpy as np
import pytest

from illumcli.formula import FUNCTIONS, MAX_LENGTH, parse
from illumcli.geometry.formula_normals import implicit_normal, parametric_normal

XYZ = ("x", "y", "z")

IMPLICIT = {
    "plane": "{a}*x + {b}*y + {c}*z",
    "sphere": "x**2 + y**2 + z**2 - {R}**2",
    "ellipsoid": "(x/{a})**2 + (y/{b})**2 + (z/{c})**2 - 1",
    "torus": "(sqrt(x*x + y*y) - {R})**2 + z*z - {r}**2",
    "paraboloid": "z - x**2/{a} - y**2/{b}",
}
PARAMETRIC = {
    "sphere": ("{R}*cos(u)*sin(v)", "{R}*sin(u)*sin(v)", "{R}*cos(v)"),
    "cylinder": ("{R}*cos(u)", "{R}*sin(u)", "v"),
    "paraboloid": ("u", "v", "{a}*u**2 + {b}*v**2"),
    "torus": ("({R} + {r}*cos(v))*cos(u)", "({R} + {r}*cos(v))*sin(u)", "{r}*sin(v)"),
}


def cases(model):
    text = lzma.decompress((files("illumcli") / "data/vectors/textbook.json.xz").read_bytes())
    return [pytest.param(c, id=c["id"]) for c in json.loads(text) if c["model"] == model]


def passes(value, case):
    expected = np.array(case["expected"])
    assert np.abs(value - expected).max() <= case["atol"] + case["rtol"] * np.abs(expected).max()


@pytest.mark.parametrize("case", cases("implicit_normal"))
def test_the_gradient_of_an_implicit_surface(case):
    inputs = dict(case["inputs"])
    f = parse(IMPLICIT[inputs["surface"]].format(**inputs), XYZ)
    passes(implicit_normal(f, np.array([inputs["point"]]))[0], case)


@pytest.mark.parametrize("case", cases("parametric_normal"))
def test_the_cross_product_of_a_parametric_surface(case):
    inputs = dict(case["inputs"])
    x, y, z = (parse(text.format(**inputs), ("u", "v")) for text in PARAMETRIC[inputs["surface"]])
    passes(parametric_normal(x, y, z, np.array([inputs["u"]]), np.array([inputs["v"]]))[0], case)


@pytest.mark.parametrize(
    "text",
    [
        *(f"{name}(x*y + 0.3)" for name, (_, slopes) in FUNCTIONS.items() if len(slopes) == 1),
        *(f"{name}(x*y, z - x)" for name, (_, slopes) in FUNCTIONS.items() if len(slopes) == 2),
        "x + y*z - 2/x",
        "-(x**3)*+y",
        "x**y",
        "2**x",
        "x**0.5",
        "(x*y/z)**2 - pi*e",
    ],
)
def test_every_derivative_agrees_with_a_central_difference(text):
    f = parse(text, XYZ)
    point = np.array([0.7, 0.4, 1.3])
    _, slopes = f.gradient(*point)
    for axis, slope in enumerate(slopes):
        step = np.eye(3)[axis] * 1e-6
        difference = (f.value(*(point + step)) - f.value(*(point - step))) / 2e-6
        np.testing.assert_allclose(slope, difference, rtol=1e-7, atol=1e-8)


def test_values_are_those_of_python():
    x = np.linspace(-2, 2, 7)
    np.testing.assert_array_equal(
        parse("-x**2 + 3*x/(1 + abs(x))", ("x",)).value(x), -(x**2) + 3 * x / (1 + abs(x))
    )
    assert parse(" 2**3**2\n- 1 ", ()).text == " 2**3**2\n- 1 "
    assert parse("2e-1*x2 + 1e2", ("x2",)).value(10.0) == 102
    assert parse("2**3**2 - 1", ("x",)).value(0.0) == 511


def test_a_constant_fills_the_shape_of_the_variables():
    value, (slope,) = parse("2", ("x",)).gradient(np.zeros(4))
    assert value.tolist() == [2.0] * 4
    assert slope.tolist() == [0.0] * 4


def test_variables_of_different_shapes_are_a_grid():
    f = parse("x + 10*y", ("x", "y"))
    assert f.value(np.arange(3)[:, None], np.arange(2)).tolist() == [[0, 10], [1, 11], [2, 12]]
    assert [slope.shape for slope in f.gradient(np.arange(3)[:, None], np.arange(2))[1]] == [(3, 2)] * 2


def test_the_derivative_of_a_square_at_zero_is_zero():
    value, (slope,) = parse("x**2 + x**0", ("x",)).gradient(np.zeros(1))
    assert (value[0], slope[0]) == (1.0, 0.0)


def test_outside_the_domain_is_nan_without_a_warning():
    value, (slope,) = parse("log(x) + 1/x", ("x",)).gradient(np.array([-1.0]))
    assert np.isnan(value[0])
    assert slope[0] == -2.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x.__class__", "position 1: not part of a formula"),
        ("x + ().__class__", "position 5: not part"),
        ("open(x)", "position 1: unknown function 'open'"),
        ("x + __import__(x)", "position 5: unknown function '__import__'"),
        ("x + w", "position 5: unknown name 'w'; there are: x, y, z, pi, e"),
        ("  x + w", "position 7"),
        ("sin(x)(y)", "position 1: not part"),
        ("sin", "unknown name 'sin'"),
        ("x^2", r"position 2: '\^' is not part of a formula; a power is written \*\*"),
        ("x if y else z", "position 1"),
        ("lambda: x", "not a formula|not part"),
        ("x and y", "position 1"),
        ("x, y", "position 1"),
        ("[x]", "position 1"),
        ("'x'", "position 1"),
        ("x // 2", "position 1"),
        ("min(x)", "min takes 2 arguments, got 1"),
        ("min(*x, y)", "position 5"),
        ("sin(x, y)", "sin takes 1 argument, got 2"),
        ("True", "position 1"),
        ("2j", "position 2"),
        ("2x", r"position 2: 'x' follows the number 2; a product is written \*"),
        ("y + 1.5e-3if x", "position 11: 'i' follows the number 1.5e-3"),
        ("1e999", "too large"),
        ("9" * 400, "too large"),
        ("x +", "not a formula"),
        ("", "not a formula"),
        ("(x", "not a formula"),
        ("x" * (MAX_LENGTH + 1), "at most 1000"),
        ("-" * 900 + "x", "deep"),
        ("(" * 250 + "x" + ")" * 250, "deep|not a formula"),
        ("x**" * 150 + "x", "position 301: nested more than 100 deep"),
    ],
)
def test_anything_else_is_refused_with_its_position(text, message):
    with pytest.raises(ValueError, match=message):
        parse(text, XYZ)


def test_many_terms_and_factors_are_not_nested():
    x = np.array([0.5, 2.0])
    np.testing.assert_allclose(parse("+".join("x" * 500), ("x",)).value(x), 500 * x)
    value, (slope,) = parse("-x*2" + "-x*2+x" * 150, ("x",)).gradient(x)
    np.testing.assert_allclose([value, slope], [-152 * x, [-152.0, -152.0]])
    np.testing.assert_allclose(parse("(" * 110 + "x" + "/2)*3" * 110, ("x",)).value(x), x * 1.5**110)
    with pytest.raises(ValueError, match="position 999: unknown name 'w'"):
        parse("x+" * 499 + "w", ("x",))


def test_towers_of_powers_are_doubles():
    assert parse("10**10**10", ("x",)).value(0.0) == np.inf
    assert parse("9**9**9**9**9**9", ("x",)).value(0.0) == np.inf
