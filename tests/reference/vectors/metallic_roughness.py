"""Vectors of `metallic_roughness`: glTF 2.0, appendix B, with Smith's G from its Lambda.

python tests/reference/vectors/metallic_roughness.py
"""

from __future__ import annotations

from typing import Any

from _cases import Vector, cases, dot, half, write
from mpmath import mpf, pi, sqrt

SOURCE = "glTF 2.0 specification, appendix B; G = 1 / (1 + Lambda(l) + Lambda(v)), Heitz (2014), eq. 72, 99"
MATERIALS: dict[str, dict[str, Any]] = {
    "plastic": {"base_color": [0.75, 0.25, 0.125], "metallic": 0.0, "roughness": 0.5},
    "gold": {"base_color": [1.0, 0.77, 0.34], "metallic": 1.0, "roughness": 0.25},
    "mixture": {"base_color": [0.2, 0.5, 0.9], "metallic": 0.4, "roughness": 0.8, "ior": 1.8},
    "rough": {"base_color": [0.9, 0.9, 0.9], "metallic": 0.1, "roughness": 1.0},
    "mirror": {"base_color": [0.5, 0.5, 0.5], "metallic": 0.5, "roughness": 0.0},
}


def response(parameters: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    h = half(l, v)
    alpha = max(mpf(parameters["roughness"]) ** 2, mpf(1) / 10000)
    ior, metallic = mpf(parameters.get("ior", 1.5)), mpf(parameters["metallic"])

    def tan2(w: Vector) -> mpf:
        return 1 / dot(n, w) ** 2 - 1

    def smith(w: Vector) -> mpf:
        return (sqrt(1 + alpha**2 * tan2(w)) - 1) / 2

    # A microfacet BRDF by slopes, and the mixture as the appendix nests it.
    D = 1 / (pi * alpha**2 * dot(n, h) ** 4 * (1 + tan2(h) / alpha**2) ** 2)
    G = 1 / (1 + smith(l) + smith(v))
    specular = D * G / (4 * dot(n, l) * dot(n, v))
    w = (1 - dot(v, h)) ** 5
    f0 = ((1 - ior) / (1 + ior)) ** 2
    f = f0 + (1 - f0) * w
    out = []
    for c in map(mpf, parameters["base_color"]):
        dielectric = (1 - f) * c / pi + f * specular
        metal = specular * (c + (1 - c) * w)
        out.append(dot(n, l) * ((1 - metallic) * dielectric + metallic * metal))
    return out


write("metallic_roughness", cases("metallic_roughness", SOURCE, MATERIALS, response))
