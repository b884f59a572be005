"""Vectors of `strauss`, from the article's formulas with its angles.

python tests/reference/vectors/strauss.py
"""

from __future__ import annotations

from typing import Any

from _cases import Vector, angle, cases, color, dot, write
from mpmath import cos, mpf, pi

DEFAULTS = {"smoothness": 0.5, "metalness": 0, "transparency": 0, "kj": 0.1, "kf": 1.12, "kg": 1.01}
MATERIALS: dict[str, dict[str, Any]] = {
    "default": {},
    "rough": {"color": [0.9, 0.4, 0.05], "smoothness": 0},
    "metal": {"color": [0.9, 0.4, 0.05], "smoothness": 0.75, "metalness": 1},
    "glassy": {"color": 0.5, "smoothness": 0.9375, "metalness": 0.25, "transparency": 0.75},
    "other_poles": {"color": 1, "smoothness": 0.25, "metalness": 0.5, "kj": 1, "kf": 1.5, "kg": 1.25},
}


def response(given: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    s, m, tr, kj, kf, kg = (mpf(given.get(key, value)) for key, value in DEFAULTS.items())

    def F(x: mpf) -> mpf:
        return (1 / (x - kf) ** 2 - 1 / kf**2) / (1 / (1 - kf) ** 2 - 1 / kf**2)

    def G(x: mpf) -> mpf:
        return (1 / (1 - kg) ** 2 - 1 / (x - kg) ** 2) / (1 / (1 - kg) ** 2 - 1 / kg**2)

    x_i, x_r = (2 * angle(n, w) / pi for w in (l, v))
    r_d, d = (1 - s**3) * (1 - tr), 1 - m * s
    r_n = 1 - tr - r_d
    r_j = min(mpf(1), r_n + (r_n + kj) * F(x_i) * G(x_i) * G(x_r))
    mirrored = tuple(2 * dot(n, l) * x - y for x, y in zip(n, l, strict=True))
    away = angle(mirrored, v)
    r_s = cos(away) ** (3 / (1 - s)) * r_j if away < pi / 2 else mpf(0)
    return [
        cos(angle(n, l)) * r_d * d * c + r_s * (1 + m * (1 - F(x_i)) * (c - 1))
        for c in color(given.get("color", 0.8))
    ]


write("strauss", cases("strauss", "Strauss (1990)", MATERIALS, response))
