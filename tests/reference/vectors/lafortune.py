"""Writes the vectors of `lafortune`, as printed: a sum of powers of weighted dot products."""

from __future__ import annotations

from typing import Any

from _cases import color, dot
from diffuse_cases import cases, write
from mpmath import mpf, pi

MIRROR = {"cx": -1, "cy": -1, "cz": 1}
BACK = {"specular": [0.3, 0.2, 0.1], "cx": 0.7, "cy": 0.7, "cz": 0.9, "exponent": 3}
PARAMETERS: list[dict[str, Any]] = [
    {},
    {"diffuse": [0.3, 0.2, 0.1], "specular": [0.1, 0.5, 2], **MIRROR, "exponent": 100},
    {"further": [BACK]},
    {"specular": 0, "further": [{}, BACK, {"specular": 0.05, "cx": -0.5, "cy": 0.5, "exponent": 0.5}]},
    {"exponent": 0, "specular": 0.1, "further": [{**MIRROR, "exponent": 1000.5}]},
]
AXES = {"cx": -0.95, "cy": -0.85, "cz": 0.9}


def response(given: dict[str, Any], n: list[mpf], l: list[mpf], v: list[mpf], t: list[mpf]) -> list[mpf]:
    """n.l (rho_d / pi + sum of rho_s max(0, Cx lx vx + Cy ly vy + Cz lz vz)^e)."""
    b = [n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]]
    out = [each / pi for each in color(given.get("diffuse", 0.6))]
    for lobe in ({**given, "further": None}, *given.get("further", ())):
        base = sum(
            mpf(lobe.get(key, default)) * dot(axis, l) * dot(axis, v)
            for (key, default), axis in zip(AXES.items(), (t, b, n), strict=True)
        )
        exponent = mpf(lobe.get("exponent", 20))
        power = max(base, mpf(0)) ** exponent if exponent else mpf(1)
        height = color(lobe.get("specular", 0.5))
        out = [x + each * power for x, each in zip(out, height, strict=True)]
    return [x * dot(n, l) for x in out]


if __name__ == "__main__":
    write("lafortune", "Lafortune et al. 1997", cases(PARAMETERS, response, tangent=[1, 0.3, 0.2]))
