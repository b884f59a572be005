"""Vectors of `lommel_seeliger`: single scattering in a half space, by quadrature over the optical depth.

python tests/reference/vectors/lommel_seeliger.py
"""

from __future__ import annotations

from typing import Any

from _cases import Vector, cases, color, dot, write
from mpmath import exp, inf, mpf, pi, quad

MATERIALS: dict[str, dict[str, Any]] = {
    "default": {},
    "white": {"diffuse": 1},
    "colour": {"diffuse": [0.9, 0.4, 0.05]},
}


def response(given: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    """Light is dimmed by exp(-depth / n.l) on its way in and by exp(-depth / n.v) on its way out; a layer
    scatters w / (4 pi) of it into every direction."""
    into, out = dot(n, l), dot(n, v)
    mean = into * out / (into + out)
    layers = mean * quad(lambda x: exp(-x * mean * (1 / into + 1 / out)), [0, 8, 32, inf])
    return [w / (4 * pi) * layers / out for w in color(given.get("diffuse", 0.8))]


write("lommel_seeliger", cases("lommel_seeliger", "Seeliger (1887); Hapke (1981)", MATERIALS, response))
