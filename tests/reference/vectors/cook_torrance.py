"""Vectors of `cook_torrance` with Smith's masking, grain, and the generalised Trowbridge-Reitz distribution.

Slopes are stretched until the surface is isotropic. Lambda has its closed form there, or is integrated over
the facets of each inclination, whose part that faces away is an arc.

python tests/reference/vectors/cook_torrance.py
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from _cases import Vector, cases, cross, dot, half, write
from mpmath import acos, cos, erf, exp, mp, mpf, pi, quad, sin, sqrt

SOURCE = "Cook and Torrance (1982); Burley (2012), appendix B; Heitz (2014), section 5, eq. 99"
BLACK = {"diffuse": [0.0, 0.0, 0.0], "specular_weight": 1.0, "fresnel": {"F": "constant"}}


def material(masking: str, **distribution: Any) -> dict[str, Any]:
    return {**BLACK, "distribution": distribution, "masking": masking}


MATERIALS: dict[str, dict[str, Any]] = {
    "beckmann_smith": material("smith", D="beckmann", m=0.3),
    "beckmann_rough_correlated": material("smith_correlated", D="beckmann", m=2.0),
    "beckmann_grain": material("smith", D="beckmann", m=0.125, m_y=0.5),
    "ggx_narrow_smith": material("smith", D="ggx", alpha=0.01),
    "ggx_correlated": material("smith_correlated", D="ggx", alpha=0.5),
    "ggx_grain_correlated": material("smith_correlated", D="ggx", alpha=0.75, alpha_y=0.125),
    "ggx_grain_v_groove": material("v_groove", D="ggx", alpha=0.25, alpha_y=0.5),
    "gtr_1_smith": material("smith", D="gtr", alpha=0.25, gamma=1.0),
    "gtr_correlated": material("smith_correlated", D="gtr", alpha=0.03125, gamma=1.5),
    "power_smith": material("smith", D="power", exponent=20.0),
    "gaussian_correlated": material("smith_correlated", D="gaussian", m=0.4),
}
Shape = Callable[[mpf], mpf]


def normalised(shape: Shape, width: mpf) -> Shape:
    """The density by the angle whose projection is 1."""
    knots = [mpf(0), *(x for x in (width, 4 * width, 16 * width) if x < pi / 2), pi / 2]
    area = 2 * pi * quad(lambda x: shape(x) * sin(x) * cos(x), knots)
    return lambda x: shape(x) / area


def density(parameters: dict[str, Any]) -> tuple[Shape, mpf]:
    """D by the angle to the normal, and its width."""
    p = {key: mpf(value) for key, value in parameters.items() if key != "D"}
    match parameters["D"]:
        case "gtr":
            a2, gamma = p["alpha"] ** 2, p["gamma"]
            return normalised(lambda x: (1 + (1 / a2 - 1) * sin(x) ** 2) ** -gamma, p["alpha"]), p["alpha"]
        case "power":
            n = p["exponent"]
            return (lambda x: (n + 2) / (2 * pi) * cos(x) ** n), 1 / sqrt(n)
        case "gaussian":
            return normalised(lambda x: exp(-((x / p["m"]) ** 2)), p["m"]), p["m"]
    raise ValueError(parameters["D"])


def integrated_lambda(D: Shape, width: mpf, theta: mpf) -> mpf:
    """Lambda of a direction at this angle to the normal."""
    if theta == 0:
        return mpf(0)

    def away(x: mpf) -> mpf:
        cotangents = cos(theta) / sin(theta) * cos(x) / sin(x)
        psi = acos(min(cotangents, mpf(1)))
        arc = sin(theta) * sin(x) * sin(psi) - cos(theta) * cos(x) * psi
        return 2 * D(x) * sin(x) * arc

    first = pi / 2 - theta
    steps = [first + width * mpf(4) ** k / 16 for k in range(8)]
    return quad(away, [first, *(x for x in steps if x < pi / 2), pi / 2]) / cos(theta)


def response(parameters: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    b, h, masking = cross(n, t), half(l, v), parameters["masking"]
    p, kind = parameters["distribution"], parameters["distribution"]["D"]
    n_l, n_v, n_h = dot(n, l), dot(n, v), dot(n, h)

    if kind in ("beckmann", "ggx"):
        name = "m" if kind == "beckmann" else "alpha"
        along = mpf(p[name])
        across = mpf(p.get(f"{name}_y", p[name]))

        def tan2(w: Vector) -> mpf:
            """Squared tangent in the space where all slopes are divided by the roughness."""
            return ((along * dot(w, t)) ** 2 + (across * dot(w, b)) ** 2) / dot(w, n) ** 2

        slope2 = ((dot(h, t) / along) ** 2 + (dot(h, b) / across) ** 2) / n_h**2
        fall = exp(-slope2) if kind == "beckmann" else 1 / (1 + slope2) ** 2
        D = fall / (pi * along * across * n_h**4)

        def smith(w: Vector) -> mpf:
            if tan2(w) == 0:
                return mpf(0)
            a = 1 / sqrt(tan2(w))
            if kind == "ggx":
                return (sqrt(1 + 1 / a**2) - 1) / 2
            return (erf(a) - 1 + exp(-(a**2)) / (a * sqrt(pi))) / 2
    else:
        by_angle, width = density(p)
        D = by_angle(acos(min(n_h, mpf(1))))

        def smith(w: Vector) -> mpf:
            return integrated_lambda(by_angle, width, acos(min(dot(n, w), mpf(1))))

    if masking == "v_groove":
        v_h = dot(v, h)
        G = min(mpf(1), 2 * n_h * n_v / v_h, 2 * n_h * n_l / v_h)
    elif masking == "smith":
        G = 1 / ((1 + smith(l)) * (1 + smith(v)))
    else:
        G = 1 / (1 + smith(l) + smith(v))
    return [D * G / (4 * n_v)] * 3


mp.dps = 30  # the quadrature's; closed forms keep more digits than a file has
write("cook_torrance", cases("cook_torrance", SOURCE, MATERIALS, response))
