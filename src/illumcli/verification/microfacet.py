"""Evaluators of Cook-Torrance and its terms: Fresnel, distributions, masking, colour shift."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats, dot
from illumcli.models import _distributions, _fresnel, _microfacet
from illumcli.models._terms import Angle
from illumcli.models.cook_torrance import CookTorrance
from illumcli.shading import terms
from illumcli.verification.inputs import Inputs
from illumcli.verification.lobes import brdf

PI = float(np.pi)

Facets = tuple[_distributions.Distribution, bool, float]
"""A distribution, True for its printed constants, and the factor between it and the case's D."""

DISTRIBUTIONS: dict[str, Callable[[Inputs], Facets]] = {
    "gaussian": lambda d: (_distributions.Gaussian(m=d.number("m"), c=d.number("c")), False, 1),
    "beckmann": lambda d: (_distributions.Beckmann(m=d.number("m")), False, 1),
    "beckmann_ct1982": lambda d: (_distributions.Beckmann(m=d.number("m")), True, 1),
    "beckmann_quarter": lambda d: (_distributions.Beckmann(m=d.number("m")), True, 1 / 4),
    "blinn": lambda d: (_distributions.Blinn(beta=d.number("beta")), True, 1),
    "blinn_normalised": lambda d: (_distributions.PowerCosine(exponent=d.number("exponent")), False, 1),
    "torrance_sparrow": lambda d: (_distributions.TorranceSparrow(beta=d.number("beta")), True, 1),
    "trowbridge_reitz": lambda d: (_distributions.TrowbridgeReitz(beta=d.number("beta")), True, 1),
    "ggx": lambda d: (_distributions.GGX(alpha=d.number("alpha")), False, 1),
}
REFLECTANCES: dict[str, Callable[[Inputs], _fresnel.Fresnel]] = {
    "dielectric": lambda f: _fresnel.Dielectric(ior=f.number("eta")),
    "conductor": lambda f: _fresnel.Conductor(n=f.color("eta"), k=f.color("k")),
    "schlick": lambda f: _fresnel.Schlick(f0=f.color("f0")),
    "one": lambda f: _fresnel.Constant(value=(1.0, 1.0, 1.0)),
}
UNDER_DGF = {"microfacet_4": 4.0, "printed_pi": PI}
"""Factor on n.l n.v in the denominator under D G F."""


def ndf(inputs: Inputs) -> Floats:
    n, h, d = inputs.unit("n"), inputs.unit("h"), inputs.part("D")
    if not dot(n, h)[0] > 0:
        return np.zeros(1, inputs.dtype)
    n_s, length2 = terms.n_s(n, h), terms.s_s(h)
    cosine, sin2 = terms.n_h(n_s, length2), terms.sin2_h(terms.nxs(n, h), n_s, length2)
    if d.value("kind") == "beckmann_slope1d":
        return _microfacet.beckmann_slope1d(cosine, sin2, d.scalars("m"))
    distribution, printed, share = d.choose("kind", DISTRIBUTIONS)(d)
    return share * distribution.density(Angle(cosine, sin2), printed)


def geometry_vgroove(inputs: Inputs) -> Floats:
    n, l, v = (inputs.unit(key) for key in ("n", "l", "v"))
    if not (dot(n, l)[0] > 0 and dot(n, v)[0] > 0):
        return np.zeros(1, inputs.dtype)
    return _microfacet.vgroove(terms.n_l(n, l), terms.n_v(n, v), terms.s_s(terms.s(l, v)))


def cook_torrance(inputs: Inputs) -> Floats:
    """f_r of the model; for combinations of D and constant that scenes do not have, by their ratio."""
    d, f = inputs.part("D"), inputs.part("F")
    distribution, printed, share = d.choose("kind", DISTRIBUTIONS)(d)
    share *= UNDER_DGF["printed_pi" if printed else "microfacet_4"] / inputs.choose("convention", UNDER_DGF)
    diffuse = CookTorrance(
        diffuse=inputs.color("albedo"), diffuse_weight=inputs.number("kd"), specular_weight=0.0
    )
    specular = CookTorrance(
        diffuse_weight=0.0,
        specular_weight=inputs.number("ks"),
        distribution=distribution,
        fresnel=f.choose("kind", REFLECTANCES)(f),
        convention="printed" if printed else "microfacet",
    )
    return brdf(diffuse, inputs) + share * brdf(specular, inputs)


def fresnel_dielectric(inputs: Inputs) -> Floats:
    return _fresnel.dielectric(inputs.scalars("cos"), inputs.scalars("eta"))


def fresnel_conductor(inputs: Inputs) -> Floats:
    return _fresnel.conductor(inputs.scalars("cos"), inputs.scalars("eta"), inputs.scalars("k"))


def fresnel_schlick(inputs: Inputs) -> Floats:
    return _fresnel.schlick(inputs.scalars("cos"), inputs.scalars("f0"))


def fresnel_sin_tan(inputs: Inputs) -> Floats:
    """The formula by angles: the dielectric at c = cos(phi)."""
    return _fresnel.dielectric(np.cos(inputs.scalars("phi")), inputs.scalars("mu"))


def eta_from_f0(inputs: Inputs) -> Floats:
    return _fresnel.eta_from_f0(inputs.scalars("f0"))


def f0_from_eta(inputs: Inputs) -> Floats:
    return _fresnel.f0_from_eta(inputs.scalars("eta"), inputs.scalars("k"))


def ct_color_shift(inputs: Inputs) -> NDArray[Any]:
    color0, color90 = (np.asarray(inputs.color(key), inputs.dtype) for key in ("color0", "color90"))
    return _fresnel.color_shift(inputs.scalars("cos"), inputs.scalars("eta"), color0, color90)


CASES = {
    f.__name__: f
    for f in (
        ndf,
        geometry_vgroove,
        cook_torrance,
        fresnel_dielectric,
        fresnel_conductor,
        fresnel_schlick,
        fresnel_sin_tan,
        eta_from_f0,
        f0_from_eta,
        ct_color_shift,
    )
}
