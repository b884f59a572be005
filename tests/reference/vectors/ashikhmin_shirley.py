"""Vectors of `ashikhmin_shirley`, from equations 4 and 5 with the half vector's azimuth.

python tests/reference/vectors/ashikhmin_shirley.py
"""

from __future__ import annotations

from typing import Any

from _cases import Vector, angle, cases, color, cross, dot, half, write
from mpmath import atan2, cos, mpf, pi, sin, sqrt

MATERIALS: dict[str, dict[str, Any]] = {
    "default": {},
    "colour": {
        "diffuse": [0.9, 0.4, 0.05],
        "specular": [0.1, 0.5, 0.3],
        "exponent_u": 5,
        "exponent_v": 50,
    },
    "even": {"diffuse": 0.5, "specular": 1, "exponent_u": 0, "exponent_v": 0},
    "sharp": {"diffuse": 0.1, "specular": 0.05, "exponent_u": 400, "exponent_v": 100},
}


def response(given: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    nu, nv = mpf(given.get("exponent_u", 100)), mpf(given.get("exponent_v", 10))
    h = half(l, v)
    n_l, n_v, c = cos(angle(n, l)), cos(angle(n, v)), cos(angle(l, v) / 2)
    phi = atan2(dot(h, cross(n, t)), dot(h, t))
    lobe = cos(angle(n, h)) ** (nu * cos(phi) ** 2 + nv * sin(phi) ** 2)
    lobe *= sqrt((nu + 1) * (nv + 1)) / (8 * pi * c * max(n_l, n_v))
    matt = 28 / (23 * pi) * (1 - (1 - n_l / 2) ** 5) * (1 - (1 - n_v / 2) ** 5)
    pairs = zip(color(given.get("diffuse", 0.6)), color(given.get("specular", 0.05)), strict=True)
    return [n_l * (lobe * (Rs + (1 - c) ** 5 * (1 - Rs)) + matt * Rd * (1 - Rs)) for Rd, Rs in pairs]


SOURCE = "Ashikhmin and Shirley (2000), eq. 4, 5"
write("ashikhmin_shirley", cases("ashikhmin_shirley", SOURCE, MATERIALS, response))
