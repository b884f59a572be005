"""Vectors of `principled`: Burley's terms, with Smith's G from its Lambda and D by slopes.

python tests/reference/vectors/principled.py
"""

from __future__ import annotations

from typing import Any

from _cases import Vector, cases, cross, dot, half, write
from mpmath import log, mpf, pi, sqrt

SOURCE = "Burley (2012), sections 5.3 to 5.6, and disney.brdf (2015)"
MATERIALS: dict[str, dict[str, Any]] = {
    "plastic": {"base_color": [0.75, 0.25, 0.125], "specular": 0.5, "roughness": 0.5},
    "metal": {"base_color": [1.0, 0.77, 0.34], "metallic": 1.0, "roughness": 0.3, "anisotropic": 0.8},
    "skin": {"base_color": [0.8, 0.5, 0.4], "subsurface": 0.7, "roughness": 0.4, "specular": 0.3},
    "cloth": {"base_color": [0.3, 0.1, 0.5], "sheen": 1.0, "sheen_tint": 0.5, "roughness": 0.9},
    "lacquer": {
        "base_color": [0.02, 0.1, 0.3],
        "specular": 0.8,
        "specular_tint": 0.6,
        "roughness": 0.6,
        "clearcoat": 1.0,
        "clearcoat_gloss": 0.5,
    },
    "black": {"base_color": [0.0, 0.0, 0.0], "sheen": 0.4, "sheen_tint": 1.0, "clearcoat": 0.3},
    "all": {
        "base_color": [0.6, 0.7, 0.2],
        "subsurface": 0.25,
        "metallic": 0.3,
        "specular": 1.0,
        "specular_tint": 1.0,
        "roughness": 0.2,
        "anisotropic": 1.0,
        "sheen": 0.7,
        "sheen_tint": 0.1,
        "clearcoat": 0.6,
        "clearcoat_gloss": 1.0,
    },
}
DEFAULTS = {
    "subsurface": 0,
    "metallic": 0,
    "specular": 0.5,
    "specular_tint": 0,
    "roughness": 0.5,
    "anisotropic": 0,
    "sheen": 0,
    "sheen_tint": 0.5,
    "clearcoat": 0,
    "clearcoat_gloss": 1,
}


def mix(a: mpf, b: mpf, share: mpf) -> mpf:
    return a * (1 - share) + b * share


def response(parameters: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    p = {name: mpf(parameters.get(name, default)) for name, default in DEFAULTS.items()}
    color = [mpf(c) for c in parameters["base_color"]]
    h, b = half(l, v), cross(n, t)
    n_l, n_v, n_h, l_h = dot(n, l), dot(n, v), dot(n, h), dot(l, h)
    rough2 = p["roughness"] ** 2
    aspect = sqrt(1 - mpf("0.9") * p["anisotropic"])
    ax, ay = max(rough2 / aspect, mpf("0.001")), max(rough2 * aspect, mpf("0.001"))

    def slope2(w: Vector, x: mpf, y: mpf) -> mpf:
        """Squared slope of w, each of its parts times a width."""
        return ((dot(w, t) * x) ** 2 + (dot(w, b) * y) ** 2) / dot(w, n) ** 2

    def masking(x: mpf, y: mpf) -> mpf:
        lambdas = [(sqrt(1 + slope2(w, x, y)) - 1) / 2 for w in (l, v)]
        return 1 / ((1 + lambdas[0]) * (1 + lambdas[1]))

    # Diffuse.
    fall_l, fall_v, fresnel = (1 - n_l) ** 5, (1 - n_v) ** 5, (1 - l_h) ** 5
    edge = mpf(1) / 2 + 2 * l_h**2 * p["roughness"]
    burley = mix(1, edge, fall_l) * mix(1, edge, fall_v)
    flat_edge = l_h**2 * p["roughness"]
    flat = mix(1, flat_edge, fall_l) * mix(1, flat_edge, fall_v)
    subsurface = mpf(5) / 4 * (flat * (1 / (n_l + n_v) - mpf(1) / 2) + mpf(1) / 2)
    diffuse = mix(burley, subsurface, p["subsurface"]) / pi

    # The highlights.
    D = 1 / (pi * ax * ay * n_h**4 * (1 + slope2(h, 1 / ax, 1 / ay)) ** 2)
    base = D * masking(ax, ay) / (4 * n_l * n_v)
    width = mix(mpf("0.1"), mpf("0.001"), p["clearcoat_gloss"])
    # GTR with the exponent 1: c / (width^2 cos^2 + sin^2), with c such that the integral of D cos is 1
    D1 = (1 - width**2) / (-2 * pi * log(width) * (width**2 * n_h**2 + 1 - n_h**2))
    quarter = mpf(1) / 4
    coat = D1 * masking(quarter, quarter) / (4 * n_l * n_v) * mix(mpf("0.04"), 1, fresnel)

    luminance = mpf("0.3") * color[0] + mpf("0.6") * color[1] + mpf("0.1") * color[2]
    out = []
    for c in color:
        tint = c / luminance if luminance else mpf(1)
        f0 = mix(mpf("0.08") * p["specular"] * mix(1, tint, p["specular_tint"]), c, p["metallic"])
        sheen = fresnel * p["sheen"] * mix(1, tint, p["sheen_tint"])
        f = (1 - p["metallic"]) * (diffuse * c + sheen)
        f += base * mix(f0, 1, fresnel) + quarter * p["clearcoat"] * coat
        out.append(f * n_l)
    return out


write("principled", cases("principled", SOURCE, MATERIALS, response))
