"""Vectors of `formula`: every term, function and constant, from the angles between the vectors.

python tests/reference/vectors/formula.py
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from _cases import Vector, angle, cases, color, cross, dot, half, write
from mpmath import atan2, cos, cosh, e, exp, log, mpf, pi, sin, sinh, sqrt, tan, tanh

Terms = dict[str, mpf]
FORMULAS: dict[str, tuple[dict[str, Any], Callable[[Terms, mpf], mpf]]] = {}


def terms(n: Vector, l: Vector, v: Vector, t: Vector) -> Terms:
    """All terms, by angles and by lengths."""
    b, h = cross(n, t), half(l, v)
    mirrored = tuple(2 * dot(n, l) * x - y for x, y in zip(n, l, strict=True))
    level = [[x - dot(n, w) * y for x, y in zip(w, n, strict=True)] for w in (l, v)]
    sizes = sin(angle(n, l)) * sin(angle(n, v))
    s = tuple(x + y for x, y in zip(l, v, strict=True))
    return {
        "n_l": cos(angle(n, l)),
        "n_v": cos(angle(n, v)),
        "n_h": cos(angle(n, h)),
        "v_h": cos(angle(l, v) / 2),
        "l_v": cos(angle(l, v)),
        "gap_nh": 2 * sin(angle(n, h) / 2) ** 2,
        "gap_rv": 2 * sin(angle(mirrored, v) / 2) ** 2,
        "sin_l": sin(angle(n, l)),
        "sin_v": sin(angle(n, v)),
        "sin2_h": sin(angle(n, h)) ** 2,
        "sin_theta_d": sin(angle(l, v) / 2),
        "cos_phi": dot(*level) / sizes if sizes > mpf(10) ** -40 else mpf(0),
        "n_s": cos(angle(n, l)) + cos(angle(n, v)),
        "s_s": dot(s, s),
        "t_l": cos(angle(t, l)),
        "t_v": cos(angle(t, v)),
        "b_l": cos(angle(b, l)),
        "b_v": cos(angle(b, v)),
        "t_s": dot(t, s),
        "b_s": dot(b, s),
        "sin_tl": sin(angle(t, l)),
        "sin_tv": sin(angle(t, v)),
    }


def formula(text: str, **parameters: Any) -> Callable[..., None]:
    """Notes a formula, and the function below it that computes the same with a number k for the parameter."""

    def note(function: Callable[[Terms, mpf], mpf]) -> None:
        given = {"response": text, "parameters": parameters}
        FORMULAS[function.__name__] = given, function

    return note


@formula("n_l * k / pi", k=[0.9, 0.4, 0.05])
def lambert(x: Terms, k: mpf) -> mpf:
    return x["n_l"] * k / pi


@formula("k * max(0, 1 - gap_rv)**7.5", k=0.75)
def phong(x: Terms, k: mpf) -> mpf:
    return k * max(mpf(0), 1 - x["gap_rv"]) ** mpf(7.5)


@formula("n_l * exp(-sin2_h / n_h**2 / k**2) / (pi * k**2 * n_h**4)", k=[0.5, 0.75, 1.5])
def beckmann(x: Terms, k: mpf) -> mpf:
    return x["n_l"] * exp(-x["sin2_h"] / x["n_h"] ** 2 / k**2) / (pi * k**2 * x["n_h"] ** 4)


@formula("sqrt(n_l / n_v) * exp(-((t_s / k)**2 + (b_s / 0.25)**2) / n_s**2) + gap_nh", k=0.5)
def ward(x: Terms, k: mpf) -> mpf:
    slopes = (x["t_s"] / k) ** 2 + 16 * x["b_s"] ** 2
    return sqrt(x["n_l"] / x["n_v"]) * exp(-slopes / x["n_s"] ** 2) + x["gap_nh"]


@formula("(1 + l_v) * k + v_h * s_s + (1 + cos_phi * sin_l * sin_v) * sin_theta_d", k=[0.25, 0.5, 1])
def azimuths(x: Terms, k: mpf) -> mpf:
    around = 1 + x["cos_phi"] * x["sin_l"] * x["sin_v"]
    return (1 + x["l_v"]) * k + x["v_h"] * x["s_s"] + around * x["sin_theta_d"]


@formula("k * sin_tl * sin_tv + (1 + t_l * b_v)**2 + abs(t_v - b_l)", k=0.5)
def strands(x: Terms, k: mpf) -> mpf:
    return k * x["sin_tl"] * x["sin_tv"] + (1 + x["t_l"] * x["b_v"]) ** 2 + abs(x["t_v"] - x["b_l"])


@formula("sin(k * n_l)**2 + cos(n_v)**2 + tan(n_h / 2) + log(1 + e * n_l) + min(n_l, n_v)", k=[1, 2, 3])
def functions(x: Terms, k: mpf) -> mpf:
    circles = sin(k * x["n_l"]) ** 2 + cos(x["n_v"]) ** 2 + tan(x["n_h"] / 2)
    return circles + log(1 + e * x["n_l"]) + min(x["n_l"], x["n_v"])


@formula("sinh(k * n_l) + cosh(n_v) + tanh(n_h) + atan2(sin_l, n_l) + mod(5.5 + n_v, k)", k=[0.75, 1.5, 3])
def hyperbolas(x: Terms, k: mpf) -> mpf:
    curves = sinh(k * x["n_l"]) + cosh(x["n_v"]) + tanh(x["n_h"])
    return curves + atan2(x["sin_l"], x["n_l"]) + (mpf(5.5) + x["n_v"]) % k


def response(given: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    function = next(function for known, function in FORMULAS.values() if known == given)
    return [function(terms(n, l, v, t), k) for k in color(given["parameters"]["k"])]


MATERIALS = {name: given for name, (given, _) in FORMULAS.items()}
write("formula", cases("formula", "the terms' definitions", MATERIALS, response))
