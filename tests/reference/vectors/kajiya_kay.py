"""Vectors of `kajiya_kay`, from the angles of light and eye to the strand.

python tests/reference/vectors/kajiya_kay.py
"""

from __future__ import annotations

from typing import Any

from _cases import Vector, angle, cases, color, write
from mpmath import cos, mpf, pi, sin

MATERIALS: dict[str, dict[str, Any]] = {
    "default": {},
    "colour": {"diffuse": [0.9, 0.4, 0.05], "specular": [0.1, 0.5, 0.3], "exponent": 3.5},
    "sharp": {"diffuse": 0, "specular": 1, "exponent": 400},
    "even": {"diffuse": 0.25, "specular": 0.75, "exponent": 0},
}


def response(given: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    """The cone of mirrored light is at pi minus the light's angle, since both directions leave the strand."""
    e = mpf(given.get("exponent", 32))
    theta_l, theta_v = angle(t, l), angle(t, v)
    away = abs(pi - theta_l - theta_v)
    gloss = max(mpf(0), cos(away)) ** e
    pairs = zip(color(given.get("diffuse", 0.6)), color(given.get("specular", 0.3)), strict=True)
    return [kd * sin(theta_l) + ks * gloss for kd, ks in pairs]


write("kajiya_kay", cases("kajiya_kay", "Kajiya and Kay (1989)", MATERIALS, response))
