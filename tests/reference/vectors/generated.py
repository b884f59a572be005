"""Vectors of `generated`: the paper's formula, with g by closed forms or by quadrature at 50 digits.

python tests/reference/vectors/generated.py

The package interpolates g, and its tolerance is what the page of the model states: `rtol` is 2e-8 without
grain and 1e-4 with one. These values themselves are closed, or integrals of one angle whose error, estimated
by mpmath from two orders, is below 1e-25.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from _cases import Vector, cases, cross, dot, half, write
from mpmath import acos, atan2, cos, erfc, exp, mpf, pi, quad, sin, sqrt

SOURCE = "Ashikhmin, Premoze, Shirley (2000), eq. 1 and 6"
MIRROR = {"specular_weight": 1.0, "fresnel": {"F": "constant"}}
Slopes = tuple[mpf, mpf, mpf, mpf]  # mean along and across the grain, width along and across it


def material(formula: str, **more: Any) -> dict[str, Any]:
    return {"distribution": {"p": "formula", "formula": formula}, **MIRROR, **more}


MATERIALS: dict[str, dict[str, Any]] = {
    "even": material("2.5"),
    "beckmann": material("exp(-(slope / 0.3)**2) / hn**4", specular_weight=0.5, fresnel={"F": "dielectric"}),
    "polished": material("exp(-(slope / 0.02)**2) / hn**4"),
    "ggx": material("(0.25 * hn**2 + sin(theta)**2)**(-2)"),
    "power": material("hn**20"),
    "ring": material("exp(-((theta - 0.5) / 0.1)**2)"),
    "brushed": material("exp(-(x / 0.1)**2 - (y / 0.5)**2) / hn**4"),
    "brushed_ggx": material("1 / ((ht / 0.25)**2 + (hb / 0.75)**2 + hn**2)**2"),
    "two": material(
        "(exp(-((x - 0.4) / 0.15)**2 - (y / 0.25)**2) + exp(-((x + 0.4) / 0.15)**2 - (y / 0.25)**2)) / hn**4"
    ),
    "leaning": material("exp(-((x - 0.4) / 0.15)**2 - ((y + 0.2) / 0.25)**2) / hn**4"),
}


def response(parameters: dict[str, Any], n: Vector, l: Vector, v: Vector, t: Vector) -> list[mpf]:
    name = next(key for key, each in MATERIALS.items() if each is parameters)
    p, mean, g = SURFACES[name]
    b = cross(n, t)

    def local(w: Vector) -> Vector:
        return dot(w, t), dot(w, b), dot(w, n)

    # rho = p(h) <h.n> F / (4 g(l) g(v)), where no more facets are seen than there are.
    h = half(l, v)
    bounded = [max(g(local(w)), mean * dot(w, n)) for w in (l, v)]
    c = dot(h, l)
    ks = mpf(parameters["specular_weight"])
    F = mpf(1) if parameters["fresnel"]["F"] == "constant" else glass(c)
    specular = dot(n, l) * p(local(h)) * mean * F / (4 * bounded[0] * bounded[1])
    return [ks * specular + (1 - ks) * mpf("0.8") / pi * dot(n, l)] * 3


def glass(c: mpf) -> mpf:
    """Fresnel's equations by the angle of refraction, for an index of 1.5."""
    inside = sqrt(1 - (1 - c * c) / mpf("2.25"))
    s = (c - mpf("1.5") * inside) / (c + mpf("1.5") * inside)
    q = (inside - mpf("1.5") * c) / (inside + mpf("1.5") * c)
    return (s * s + q * q) / 2


# --- p with integral 1, <h.n> and g ----------------------------------------------------------------------


def around(profile: Callable[[mpf], mpf]) -> tuple[Any, ...]:
    """A distribution of theta alone, by quadrature."""
    breaks = [mpf(0), mpf("0.2"), mpf("0.5"), mpf("0.8"), pi / 2]

    def integral(f: Callable[[mpf], mpf], points: list[mpf]) -> mpf:
        value, error = quad(f, points, error=True, maxdegree=9)
        assert error < 1e-25 * abs(value), error
        return value

    whole = integral(lambda x: 2 * pi * profile(x) * sin(x), breaks)
    mean = integral(lambda x: 2 * pi * profile(x) * sin(x) * cos(x), breaks) / whole

    def g(k: Vector) -> mpf:
        sine, cosine = sqrt(k[0] ** 2 + k[1] ** 2), k[2]
        edge = atan2(cosine, sine)  # of facets that are seen all around

        def ring(x: mpf) -> mpf:
            a, b = cos(x) * cosine, sin(x) * sine
            c = min(a / b, mpf(1))
            return 2 * b * (c * acos(-c) + sqrt((1 - c) * (1 + c)))

        # Up to the edge facets are seen all around; beyond it the ring has a root: x = edge + s^2.
        points = [x for x in breaks if x < edge] + [edge]
        total = integral(lambda x: 2 * pi * profile(x) * sin(x) * cos(x) * cosine, points)
        rest = sqrt(pi / 2 - edge)
        if rest > 0:
            points = [mpf(0), *(sqrt(x - edge) for x in breaks if edge < x < pi / 2), rest]
            total += integral(
                lambda s: 2 * s * profile(edge + s * s) * sin(edge + s * s) * ring(edge + s * s), points
            )
        return total / whole

    return lambda h: profile(atan2(sqrt(h[0] ** 2 + h[1] ** 2), h[2])) / whole, mean, g


def smith(D: Callable[[Vector], mpf], seen: Callable[[Vector], mpf], mean: mpf) -> tuple[Any, ...]:
    """A normalised D whose projected area is closed: p = D <h.n>, g = <h.n> times the area."""
    return lambda h: D(h) * mean, mean, lambda k: mean * seen(k)


def gaussians(*lobes: Slopes) -> tuple[Any, ...]:
    """Equal shares of the surface whose leans have normal distributions; their projected area is closed.

    <h.n> cancels in rho, any value serves.
    """

    def D(h: Vector) -> mpf:
        x, y = h[0] / h[2], h[1] / h[2]
        each = (exp(-(((x - a) / c) ** 2) - ((y - b) / d) ** 2) / (pi * c * d) for a, b, c, d in lobes)
        return sum(each) / len(lobes) / h[2] ** 4

    def seen(k: Vector) -> mpf:
        total = mpf(0)
        for a, b, c, d in lobes:  # the mean of max(0, z) for z normal
            middle = k[2] + k[0] * a + k[1] * b
            spread = sqrt((c * k[0]) ** 2 + (d * k[1]) ** 2)
            if spread == 0:
                total += max(middle, 0)
            else:
                r = middle / spread
                total += spread * exp(-r * r) / (2 * sqrt(pi)) + middle * erfc(-r) / 2
        return total / len(lobes)

    return smith(D, seen, mpf("0.9"))


def ggx(c: mpf, d: mpf) -> tuple[Any, ...]:
    def D(h: Vector) -> mpf:
        return 1 / (pi * c * d * ((h[0] / c) ** 2 + (h[1] / d) ** 2 + h[2] ** 2) ** 2)

    def seen(k: Vector) -> mpf:
        return (k[2] + sqrt(k[2] ** 2 + (c * k[0]) ** 2 + (d * k[1]) ** 2)) / 2

    return smith(D, seen, mpf("0.9"))


ZERO = mpf(0)
SURFACES: dict[str, tuple[Any, ...]] = {
    "even": (lambda h: 1 / (2 * pi), mpf("0.5"), lambda k: (1 + k[2]) / 4),
    "beckmann": gaussians((ZERO, ZERO, mpf("0.3"), mpf("0.3"))),
    "polished": gaussians((ZERO, ZERO, mpf("0.02"), mpf("0.02"))),
    "ggx": ggx(mpf("0.5"), mpf("0.5")),
    "power": around(lambda x: cos(x) ** 20),
    "ring": around(lambda x: exp(-(((x - mpf("0.5")) * 10) ** 2))),
    "brushed": gaussians((ZERO, ZERO, mpf("0.1"), mpf("0.5"))),
    "brushed_ggx": ggx(mpf("0.25"), mpf("0.75")),
    "two": gaussians(
        (mpf("0.4"), ZERO, mpf("0.15"), mpf("0.25")), (-mpf("0.4"), ZERO, mpf("0.15"), mpf("0.25"))
    ),
    "leaning": gaussians((mpf("0.4"), -mpf("0.2"), mpf("0.15"), mpf("0.25"))),
}


GRAINED = ("brushed", "brushed_ggx", "two", "leaning")


def tolerant(entries: Any) -> Any:
    """The cases with the tolerance that the page of the model states."""
    for entry in entries:
        parameters = entry["inputs"]["parameters"]
        has_grain = any(parameters is MATERIALS[name] for name in GRAINED)
        yield entry | {"rtol": 1e-4 if has_grain else 2e-8}


write("generated", tolerant(cases("generated", SOURCE, MATERIALS, response)))
