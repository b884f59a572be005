"""Vectors of `oren_nayar`, both forms, from the paper's formulas with its angles.

python tests/reference/vectors/oren_nayar.py
"""

from __future__ import annotations

from typing import Any

from _cases import Vector, angle, cases, color, dot, write
from mpmath import cos, mpf, pi, sin, sqrt, tan

MATERIALS: dict[str, dict[str, Any]] = {
    "default": {},
    "smooth": {"diffuse": 0.5, "sigma": 0},
    "colour": {"diffuse": [0.9, 0.4, 0.05], "sigma": 0.5},
    "clamped": {"diffuse": [1.0, 0.1, 0.001], "sigma": 1.5},
    "qualitative": {"diffuse": [0.9, 0.4, 0.05], "sigma": 0.5, "form": "qualitative"},
    "qualitative_rough": {"diffuse": 1, "sigma": 1.5, "form": "qualitative"},
}


def cos_azimuth(n: Vector, l: Vector, v: Vector) -> mpf:
    """The cosine of the azimuth between light and eye; 0 where one of them is along the normal."""
    level = [[x - dot(n, w) * y for x, y in zip(w, n, strict=True)] for w in (l, v)]
    sizes = [sqrt(dot(w, w)) for w in level]
    return dot(*level) / (sizes[0] * sizes[1]) if min(sizes) > mpf(10) ** -40 else mpf(0)


def response(given: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    rho, s2 = color(given.get("diffuse", 0.8)), mpf(given.get("sigma", 0.3)) ** 2
    theta_i, theta_r = angle(n, l), angle(n, v)
    alpha, beta = max(theta_i, theta_r), min(theta_i, theta_r)
    C = cos_azimuth(n, l, v)
    A, B = 1 - s2 / (s2 + mpf("0.33")) / 2, mpf("0.45") * s2 / (s2 + mpf("0.09"))
    if given.get("form") == "qualitative":
        shape = A + B * max(mpf(0), C) * sin(alpha) * tan(beta)
        return [each * shape * cos(theta_i) / pi for each in rho]
    C2 = B * (sin(alpha) - ((2 * beta / pi) ** 3 if C < 0 else 0))
    C3 = mpf("0.125") * s2 / (s2 + mpf("0.09")) * (4 * alpha * beta / pi**2) ** 2
    once = A + C * tan(beta) * C2 + (1 - abs(C)) * C3 * tan((alpha + beta) / 2)
    twice = mpf("0.17") * s2 / (s2 + mpf("0.13")) * (1 - C * (2 * beta / pi) ** 2)
    return [max(mpf(0), each * once + each**2 * twice) * cos(theta_i) / pi for each in rho]


write("oren_nayar", cases("oren_nayar", "Oren and Nayar (1994)", MATERIALS, response))
