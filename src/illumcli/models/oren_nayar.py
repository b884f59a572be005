"""Oren-Nayar: a rough surface of Lambertian facets, brighter towards the light than a Lambertian surface.

response = n_l * max(0, f1 + f2)                                                 form: full
f1 = rho / pi * (C1 + C C2 tan(beta) + (1 - |C|) C3 tan((alpha + beta) / 2))     one bounce
f2 = 0.17 rho^2 / pi * s2 / (s2 + 0.13) * (1 - C (2 beta / pi)^2)                two bounces
response = n_l * rho / pi * (A + B max(0, C) sin(alpha) tan(beta))               form: qualitative

alpha and beta are the larger and the smaller of the angles of light and eye to the normal, C the cosine of
the azimuth between them, s2 = sigma^2.

C1 = A = 1 - s2 / (2 (s2 + 0.33))
C2 = B * sin(alpha), or B * (sin(alpha) - (2 beta / pi)^3) where C < 0;  B = 0.45 s2 / (s2 + 0.09)
C3 = 0.125 s2 / (s2 + 0.09) * (4 alpha beta / pi^2)^2

A BRDF times the cosine, reciprocal. It is a fit: a white surface reflects up to 5 % (qualitative: 1.5 %) more
light than is incident, and f1 is negative for opposite azimuths near grazing at large sigma, hence the clamp.

Not followed: 0.3 for 0.33 in C1; rho / pi for rho^2 / pi in f2, which is for two bounces.

References
----------
Oren, M., Nayar, S. K. (1994). Generalization of Lambert's reflectance model. SIGGRAPH '94.
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel, Lobe
from illumcli.models._lobes import channels, tint
from illumcli.models._parameters import Spread, Varying
from illumcli.schema.fields import Albedo


def oren_nayar_terms(
    n_l: Floats, n_v: Floats, sin_l: Floats, sin_v: Floats, cos_phi: Floats, sigma: Floats
) -> tuple[Floats, Floats]:
    """f1 in units of rho / pi and f2 in units of rho^2 / pi, before the clamp.

    Angles are computed as 1 - 2 alpha / pi and 1 - 2 beta / pi, which are accurate at grazing, where
    sin(alpha) - (2 beta / pi)^3 would cancel.

    Parameters
    ----------
    n_l, n_v, sin_l, sin_v : float arrays
        Cosine and sine of the angles of light and eye to the normal.
    cos_phi : float array
        Cosine of the azimuth between them.
    sigma : float or array
        Standard deviation of the facets' slope angle, radians.
    """
    # alpha is the larger angle, beta the smaller.
    s2 = np.square(sigma)
    cos_alpha, cos_beta = np.minimum(n_l, n_v), np.maximum(n_l, n_v)
    sin_alpha, sin_beta = np.maximum(sin_l, sin_v), np.minimum(sin_l, sin_v)
    rise = np.arctan2(cos_alpha, sin_alpha) * (2 / np.pi)  # 1 - 2 alpha / pi
    y = np.arctan2(cos_beta, sin_beta) * (2 / np.pi)  # 1 - 2 beta / pi
    x = 1 - y

    # The three terms of f1, and f2.
    opposite = cos_phi < 0
    bulge = y * (3 - 3 * y + y * y) - np.square(cos_alpha) / (1 + sin_alpha)
    C1 = 1 - s2 / (s2 + 0.33) / 2
    C2 = 0.45 * s2 / (s2 + 0.09) * (sin_alpha * ~opposite + bulge * opposite)
    C3 = 0.125 * s2 / (s2 + 0.09) * np.square(x * (1 - rise))
    tan_mean = (sin_alpha + sin_beta) / (cos_alpha + cos_beta)
    f1 = C1 + cos_phi * C2 * (sin_beta / cos_beta) + (1 - np.abs(cos_phi)) * C3 * tan_mean
    f2 = 0.17 * s2 / (s2 + 0.13) * (1 - cos_phi * np.square(x))
    return f1, f2


def oren_nayar_ab(n_l: Floats, n_v: Floats, l_v: Floats, sigma: Floats) -> Floats:
    """A + B max(0, C) sin(alpha) tan(beta), with C sin(alpha) tan(beta) = (l.v - a b) / max(a, b) for the
    cosines a = n_l, b = n_v."""
    s2 = np.square(sigma)
    A, B = 1 - s2 / (s2 + 0.33) / 2, 0.45 * s2 / (s2 + 0.09)
    return A + B * np.maximum(l_v - n_l * n_v, 0) / np.maximum(n_l, n_v)


class OrenNayar(IlluminationModel):
    model: Literal["oren_nayar"] = "oren_nayar"
    diffuse: Varying[Albedo] = (0.8, 0.8, 0.8)
    """rho, the albedo of the facets."""
    sigma: Varying[Spread] = 0.3
    """sigma, standard deviation of the facets' slope angle [rad]: 0 is Lambert, 0.5 clay or plaster."""
    form: Literal["full", "qualitative"] = "full"
    """`full`: all terms, with the second bounce. `qualitative`: the authors' simplified form with A, B."""

    reciprocal: ClassVar[bool] = True
    physical: ClassVar[bool] = True

    def lobes(self) -> dict[str, Lobe]:
        """The diffuse lobe in the chosen form; the qualitative one needs no angles."""
        lobes = super().lobes()
        if "diffuse" in lobes and self.form == "qualitative":
            lobes["diffuse"] = self.qualitative_lobe
        return lobes

    def diffuse_lobe(
        self, n_l: Floats, n_v: Floats, sin_l: Floats, sin_v: Floats, cos_phi: Floats
    ) -> Vectors:
        """(N, 3) n_l * max(0, f1 + f2)."""
        (sigma,) = as_dtype_of(n_l, self.sigma)
        one, two = oren_nayar_terms(n_l, n_v, sin_l, sin_v, cos_phi, sigma)
        rho = channels(n_l, self.diffuse)
        return (np.maximum(one + rho * two, 0) * rho * (n_l / np.pi)).T

    def qualitative_lobe(self, n_l: Floats, n_v: Floats, l_v: Floats) -> Vectors:
        """(N, 3) n_l * rho / pi * (A + B ...)."""
        (sigma,) = as_dtype_of(n_l, self.sigma)
        return tint(self.diffuse, oren_nayar_ab(n_l, n_v, l_v, sigma) * (n_l / np.pi))
