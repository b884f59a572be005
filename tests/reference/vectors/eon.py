"""Writes the vectors of `eon`, from listing 1 of the paper, the exact branch."""

from __future__ import annotations

from typing import Any

import mpmath
from _cases import color, dot
from diffuse_cases import cases, write
from mpmath import mpf, pi

PARAMETERS: list[dict[str, Any]] = [
    {},
    {"diffuse": 1, "roughness": 1},
    {"diffuse": [0.9, 0.4, 0.05], "roughness": 0.25},
    {"diffuse": 1, "roughness": 1e-6},
    {"diffuse": [1, 0.999, 0.001], "roughness": 0.7},
    {"diffuse": 0.18, "roughness": 1},
    {"diffuse": 0.8, "roughness": 0},
]
C1 = mpf(1) / 2 - 2 / (3 * pi)
C2 = mpf(2) / 3 - 28 / (15 * pi)


def albedo(mu: mpf, r: mpf) -> mpf:
    """E of a single bounce with rho = 1."""
    A = 1 / (1 + C1 * r)
    si = mpmath.sqrt(max(1 - mu * mu, mpf(0)))
    G = si * (mpmath.acos(min(mu, mpf(1))) - si * mu) + mpf(2) / 3 * (si / mu * (1 - si**3) - si)
    return A + r * A / pi * G


def response(given: dict[str, Any], n: list[mpf], l: list[mpf], v: list[mpf]) -> list[mpf]:
    """The BRDF times the cosine; without roughness, where listing 1 has 0 / 0, Lambert."""
    rho = color(given.get("diffuse", 0.8))
    r = mpf(given.get("roughness", 0.5))
    mu_i, mu_o = dot(n, l), dot(n, v)
    if not r:
        return [each / pi * mu_i for each in rho]
    s = dot(l, v) - mu_i * mu_o
    over = s / max(mu_i, mu_o) if s > 0 else s
    A = 1 / (1 + C1 * r)
    mean = A * (1 + C2 * r)
    out = []
    for each in rho:
        single = each / pi * A * (1 + r * over)
        rho_ms = each**2 * mean / (1 - each * (1 - mean))
        several = rho_ms / pi * (1 - albedo(mu_i, r)) * (1 - albedo(mu_o, r)) / (1 - mean)
        out.append((single + several) * mu_i)
    return out


if __name__ == "__main__":
    write("eon", "Portsmouth, Kutz and Hill 2025, listing 1", cases(PARAMETERS, response))
