"""Vectors of `blinn_phong`, both forms; the normalisation is integrated over the hemisphere.

python tests/reference/vectors/blinn_phong.py
"""

from __future__ import annotations

from typing import Any

from _cases import Vector, angle, cases, color, half, write
from mpmath import cos, mpf, pi, quad, sin

MATERIALS: dict[str, dict[str, Any]] = {
    "default": {},
    "colour": {"diffuse": [0.9, 0.4, 0.05], "specular": [0.1, 0.5, 0.3], "exponent": 3.5},
    "sharp": {"diffuse": 0, "specular": 1, "exponent": 400},
    "normalised": {"diffuse": 0.5, "specular": [0.1, 0.5, 0.3], "exponent": 7, "normalised": True},
    "normalised_even": {"diffuse": 0.25, "specular": 0.75, "exponent": 0, "normalised": True},
}


def response(given: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    e, cosine = mpf(given.get("exponent", 32)), cos(angle(n, l))
    matt, gloss = cosine, cos(angle(n, half(l, v))) ** e
    if given.get("normalised"):
        # For an eye on the normal the half vector is half way to the light.
        whole = 2 * pi * quad(lambda x: cos(x / 2) ** e * cos(x) * sin(x), [0, pi / 4, pi / 2])
        matt, gloss = cosine / pi, cosine * gloss / whole
    pairs = zip(color(given.get("diffuse", 0.8)), color(given.get("specular", 0.2)), strict=True)
    return [kd * matt + ks * gloss for kd, ks in pairs]


write("blinn_phong", cases("blinn_phong", "Blinn (1977); Giesen (2009)", MATERIALS, response))
