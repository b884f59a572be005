"""Vectors of `minnaert`, from Minnaert's law with powers of the cosines of angles.

python tests/reference/vectors/minnaert.py
"""

from __future__ import annotations

from typing import Any

from _cases import Vector, angle, cases, color, write
from mpmath import cos, mpf, pi, quad

MATERIALS: dict[str, dict[str, Any]] = {
    "default": {},
    "moon": {"diffuse": 0.12, "k": 0.5},
    "least": {"diffuse": [0.9, 0.4, 0.05], "k": 0},
    "dark_rim": {"diffuse": 1, "k": 2},
    "largest": {"diffuse": 0.8, "k": 10},
}


def response(given: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    """B cos^k(i) cos^(k - 1)(e), where the albedo for an eye on the normal is rho."""
    k = mpf(given.get("k", 0.7))
    scale = 1 / (2 * pi * quad(lambda c: c**k, [0, 1]))
    shape = cos(angle(n, l)) ** k * cos(angle(n, v)) ** (k - 1) * scale
    return [rho * shape for rho in color(given.get("diffuse", 0.8))]


write("minnaert", cases("minnaert", "Minnaert (1941)", MATERIALS, response))
