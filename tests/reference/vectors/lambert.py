"""Vectors of `lambert`: the cosine law with the angle itself.

python tests/reference/vectors/lambert.py
"""

from __future__ import annotations

from typing import Any

from _cases import Vector, angle, cases, color, write
from mpmath import cos, mpf, pi

MATERIALS: dict[str, dict[str, Any]] = {
    "default": {},
    "white": {"diffuse": 1},
    "colour": {"diffuse": [0.9, 0.4, 0.05]},
}


def response(given: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    return [rho * cos(angle(n, l)) / pi for rho in color(given.get("diffuse", 0.8))]


write("lambert", cases("lambert", "Lambert (1760)", MATERIALS, response))
