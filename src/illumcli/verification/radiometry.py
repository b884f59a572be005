"""Evaluators of the radiometry cases: distance laws, photometry law, Lambert, the ambient equation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from illumcli.arrays import Floats, Vectors, dot
from illumcli.lights._attenuation import InverseSquare, InverseSquareFlux, Law, Polynomial
from illumcli.lights.point import Point
from illumcli.models.lambert import Lambert
from illumcli.render_space import RenderSpace
from illumcli.shading.ambient import ambient, coupled
from illumcli.verification.inputs import Inputs
from illumcli.verification.lobes import brdf, response

WHITE = (1.0, 1.0, 1.0)
HERE = RenderSpace((0.0, 0.0, 0.0), 1.0)


def polynomial(inputs: Inputs) -> Polynomial:
    """The law 1 / (c1 + c2 d + c3 d^2) of a case."""
    return Polynomial(law="polynomial", **{key: inputs.number(key) for key in ("c1", "c2", "c3")})


def attenuation(inputs: Inputs) -> Floats:
    laws: dict[str, Callable[[], Law]] = {
        "quadratic": lambda: polynomial(inputs),
        "inverse_square": lambda: InverseSquare(law="inverse_square"),
        "inverse_4pi_square": lambda: InverseSquareFlux(law="inverse_square_flux"),
    }
    return inputs.choose("kind", laws)().factor(inputs.scalars("d"))


def photometry_law(inputs: Inputs) -> Floats:
    """E = I <n.l> / d^2."""
    x, y, z = inputs.vectors("light_position")[0]
    arriving = Point(light="point", position=(float(x), float(y), float(z))).sample_at(
        inputs.vectors("point"), HERE
    )
    cosine = np.maximum(dot(inputs.unit("n"), arriving.l), 0)
    return inputs.scalars("intensity") * arriving.irradiance_scale * cosine


def lambert_brdf(inputs: Inputs) -> Floats:
    return brdf(Lambert(diffuse=inputs.color("albedo")), inputs)


def lambert_radiance(inputs: Inputs) -> Floats:
    """L = albedo / pi * <n.l> * I / d^2."""
    law = InverseSquare(law="inverse_square")
    n, l = inputs.unit("n"), inputs.unit("l")
    model = Lambert(diffuse=inputs.color("albedo"))
    irradiance = inputs.scalars("intensity") * law.factor(inputs.scalars("distance"))
    return response(model, n=n, l=l)[:, 0] * irradiance


def lighting_12_75(inputs: Inputs) -> Floats:
    """Ambient light times obscurance plus direct light: separate, or coupled as printed in one text."""
    n, kd, w = inputs.unit("n"), inputs.scalars("kd"), inputs.scalars("w")
    ka_light = (inputs.scalars("ka") * inputs.scalars("Ia"))[:, None]
    law = InverseSquare(law="inverse_square")
    direct = np.zeros_like(kd)
    for light in inputs.parts("lights"):
        irradiance = light.scalars("intensity") * law.factor(light.scalars("distance"))
        direct += light.scalars("delta") * irradiance * np.maximum(dot(n, light.unit("l")), 0)
    forms: dict[str, Callable[[], Vectors]] = {
        "corrected": lambda: ambient(WHITE, ka_light, w) + kd * direct,
        "printed": lambda: coupled(WHITE, ka_light, (kd * direct)[:, None], direct[:, None], w),
    }
    return inputs.choose("form", forms)()[:, 0]


CASES = {f.__name__: f for f in (attenuation, photometry_law, lambert_brdf, lambert_radiance, lighting_12_75)}
