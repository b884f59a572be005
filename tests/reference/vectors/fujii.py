"""Writes the vectors of `fujii`, from Fujii's page, with angles in place of dot products."""

from __future__ import annotations

from typing import Any

import mpmath
from _cases import color, dot
from diffuse_cases import cases, write
from mpmath import mpf, pi

PARAMETERS: list[dict[str, Any]] = [
    {},
    {"diffuse": 1, "roughness": 1},
    {"diffuse": [0.9, 0.4, 0.05], "roughness": 0.25},
    {"diffuse": 0.5, "roughness": 1e-6},
    {"diffuse": 1, "sigma": 0.3},
    {"diffuse": [0.9, 0.4, 0.05], "sigma": 0.7},
    {"diffuse": 0.18, "sigma": 1.5708},
    {"diffuse": 0.8, "sigma": 0},
]


def response(given: dict[str, Any], n: list[mpf], l: list[mpf], v: list[mpf]) -> list[mpf]:
    """rho cos(theta_i) (A + B cos(phi) sin(theta_i) sin(theta_r) / t)."""
    rho = color(given.get("diffuse", 0.8))
    theta_i, theta_r = (mpmath.acos(min(dot(n, w), mpf(1))) for w in (l, v))
    level = [[x - dot(n, w) * y for x, y in zip(w, n, strict=True)] for w in (l, v)]
    s = dot(*level)  # cos(phi) sin(theta_i) sin(theta_r): the product of the projections
    t = max(mpmath.cos(theta_i), mpmath.cos(theta_r)) if s > 0 else mpf(1)
    if "sigma" in given:
        s2 = mpf(given["sigma"]) ** 2
        B = mpf("0.45") * s2 / (s2 + mpf("0.09")) / pi
        A = [
            (1 - s2 / (s2 + mpf("0.33")) / 2 + mpf("0.17") * each * s2 / (s2 + mpf("0.13"))) / pi
            for each in rho
        ]
    else:
        sigma = mpf(given.get("roughness", 0.5))
        A = [1 / (pi + (pi / 2 - mpf(2) / 3) * sigma)] * 3
        B = sigma * A[0]
    return [each * mpmath.cos(theta_i) * (a + B * s / t) for each, a in zip(rho, A, strict=True)]


if __name__ == "__main__":
    write("fujii", "Fujii 2013", cases(PARAMETERS, response))
