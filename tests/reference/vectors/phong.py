"""Vectors of `phong`, both forms: the mirrored light by reflection, a power of the cosine of an angle.

python tests/reference/vectors/phong.py
"""

from __future__ import annotations

from typing import Any

from _cases import Vector, angle, cases, color, dot, write
from mpmath import cos, mpf, pi

MATERIALS: dict[str, dict[str, Any]] = {
    "default": {},
    "colour": {"diffuse": [0.9, 0.4, 0.05], "specular": [0.1, 0.5, 0.3], "exponent": 3.5},
    "sharp": {"diffuse": 0, "specular": 1, "exponent": 100},
    "normalised": {"diffuse": 0.5, "specular": [0.1, 0.5, 0.3], "exponent": 7, "normalised": True},
    "normalised_even": {"diffuse": 0.25, "specular": 0.75, "exponent": 0, "normalised": True},
}


def response(given: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    e, cosine = mpf(given.get("exponent", 32)), cos(angle(n, l))
    mirrored = tuple(2 * dot(n, l) * x - y for x, y in zip(n, l, strict=True))
    away = angle(mirrored, v)
    gloss = max(mpf(0), cos(away)) ** e
    matt = cosine
    if given.get("normalised"):
        matt, gloss = cosine / pi, cosine * gloss * (e + 2) / (2 * pi)
    pairs = zip(color(given.get("diffuse", 0.8)), color(given.get("specular", 0.2)), strict=True)
    return [kd * matt + ks * gloss for kd, ks in pairs]


write("phong", cases("phong", "Phong (1975); Lewis (1994)", MATERIALS, response))
