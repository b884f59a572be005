"""Vectors of `burley`, from the course notes: FD90 with the angle between light and half vector.

python tests/reference/vectors/burley.py
"""

from __future__ import annotations

from typing import Any

from _cases import Vector, angle, cases, color, write
from mpmath import cos, mpf, pi

MATERIALS: dict[str, dict[str, Any]] = {
    "default": {},
    "smooth": {"diffuse": [0.9, 0.4, 0.05], "roughness": 0},
    "rough": {"diffuse": 1, "roughness": 1},
    "satin": {"diffuse": 0.18, "roughness": 0.3},
}


def response(given: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    """rho / pi (1 + (FD90 - 1)(1 - cos theta_l)^5) (1 + (FD90 - 1)(1 - cos theta_v)^5), times cos theta_l."""
    theta_d = angle(l, v) / 2
    grazing = mpf(1) / 2 + 2 * mpf(given.get("roughness", 0.5)) * cos(theta_d) ** 2
    shape = cos(angle(n, l)) / pi
    for w in (l, v):
        shape *= 1 + (grazing - 1) * (1 - cos(angle(n, w))) ** 5
    return [rho * shape for rho in color(given.get("diffuse", 0.8))]


write("burley", cases("burley", "Burley (2012), section 5.3", MATERIALS, response))
