"""Vectors of `poulin_fournier`: the sum over the facets of a groove, by quadrature over their slope.

python tests/reference/vectors/poulin_fournier.py
"""

from __future__ import annotations

from typing import Any

from _cases import Vector, cases, color, cross, dot, half, write
from mpmath import atan2, cos, mp, mpf, pi, quad, sin

PIECES = 16
MATERIALS: dict[str, dict[str, Any]] = {
    "default": {},
    "diffuse": {"diffuse": [0.9, 0.4, 0.05], "specular": 0, "slope": 1.25},
    "flat": {"diffuse": 0.5, "specular": 0.5, "exponent": 5, "slope": 0.001},
    "brushed": {"diffuse": 0, "specular": [0.9, 0.4, 0.05], "exponent": 1000, "slope": 0.25},
    "steep": {"diffuse": 0.25, "specular": 0.75, "exponent": 2.5, "slope": 1.5},
    "even": {"diffuse": 0, "specular": 1, "exponent": 0, "slope": 0.75},
}


def response(given: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    b, h = cross(n, t), half(l, v)
    e, steepest = mpf(given.get("exponent", 32)), mpf(given.get("slope", 0.5))

    def facets(shininess: mpf) -> mpf:
        """The integral of <n_psi.h>^shininess <n_psi.l> <n_psi.v>."""

        def one(psi: mpf) -> mpf:
            facet = [x * cos(psi) + y * sin(psi) for x, y in zip(n, b, strict=True)]
            lit, seen, gloss = (max(mpf(0), dot(facet, w)) for w in (l, v, h))
            return lit * seen * gloss**shininess if gloss else mpf(0)

        # Facets turn away from a direction a quarter turn from it; in short pieces the highlight is smooth.
        ends = [atan2(dot(w, b), dot(w, n)) + side * pi / 2 for w in (l, v, h) for side in (-1, 1)]
        ends += [steepest * k / PIECES for k in range(-PIECES, PIECES + 1)]
        inside = sorted(x for x in ends if abs(x) <= steepest)
        largest = max(map(one, inside)) or mpf(1)  # the error of quad is absolute
        return largest * quad(lambda psi: one(psi) / largest, inside, method="gauss-legendre")

    scale = 1 / (2 * sin(steepest) * dot(n, v))
    matt, gloss = facets(mpf(0)) / pi, facets(e) * (e + 2) / (2 * pi)
    pairs = zip(color(given.get("diffuse", 0.6)), color(given.get("specular", 0.2)), strict=True)
    return [scale * (kd * matt + ks * gloss) for kd, ks in pairs]


mp.dps = 30  # the quadrature's
write("poulin_fournier", cases("poulin_fournier", "Poulin and Fournier (1990)", MATERIALS, response))
