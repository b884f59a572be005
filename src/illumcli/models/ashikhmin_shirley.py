"""Ashikhmin-Shirley: an anisotropic highlight with Fresnel, and a diffuse part that conserves energy.

response = n_l * (specular + diffuse)
specular = sqrt((nu + 1) (nv + 1)) / (8 pi) * (n.h)^p / (c max(n_l, n_v)) * (Rs + (1 - Rs) (1 - c)^5)
p = (nu (h.t)^2 + nv (h.b)^2) / (1 - (n.h)^2),  c = l.h
diffuse = 28 Rd / (23 pi) (1 - Rs) (1 - (1 - n_l / 2)^5) (1 - (1 - n_v / 2)^5)

t is the direction of the grain, b = n x t. A BRDF times the cosine, reciprocal. Not to be confused with the
microfacet generator of Ashikhmin, Premoze and Shirley, published the same year.

References
----------
Ashikhmin, M., Shirley, P. (2000). An anisotropic Phong BRDF model. Journal of Graphics Tools 5(2), eq. 4, 5.
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel
from illumcli.models._fresnel import schlick
from illumcli.models._lobes import channels, log_cos
from illumcli.models._parameters import Varying
from illumcli.models._terms import Components
from illumcli.schema.fields import Albedo, NonNegative


class AshikhminShirley(IlluminationModel):
    model: Literal["ashikhmin_shirley"] = "ashikhmin_shirley"
    diffuse: Varying[Albedo] = (0.6, 0.6, 0.6)
    """Rd, the diffuse albedo."""
    specular: Varying[Albedo] = (0.05, 0.05, 0.05)
    """Rs, the specular reflectance at normal incidence."""
    exponent_u: Varying[NonNegative] = 100.0
    """nu, exponent along the grain; 0 to 10^6 and beyond."""
    exponent_v: Varying[NonNegative] = 10.0
    """nv, exponent across the grain; if equal to nu, the surface is isotropic."""

    scales: ClassVar[dict[str, tuple[str, ...]]] = {"diffuse_lobe": ("diffuse",)}
    reciprocal: ClassVar[bool] = True
    conserving: ClassVar[bool] = True
    isotropic: ClassVar[bool] = False
    physical: ClassVar[bool] = True

    def has_grain(self) -> bool:
        """True unless the exponents along and across the grain are equal."""
        return self.exponent_u != self.exponent_v

    def diffuse_lobe(self, n_l: Floats, n_v: Floats) -> Vectors:
        """(N, 3) n_l * diffuse."""
        Rd, Rs = channels(n_l, self.diffuse), channels(n_l, self.specular)
        shape = n_l * _rise(n_l) * _rise(n_v) * (28 / (23 * np.pi))
        return (Rd * (1 - Rs) * shape).T

    def specular_lobe(
        self, n_l: Floats, n_v: Floats, s_s: Floats, v_h: Floats, n_h: Floats, s_local: Components
    ) -> Vectors:
        """(N, 3) n_l * specular."""
        nu, nv = as_dtype_of(n_l, self.exponent_u, self.exponent_v)
        along, across = np.square(s_local.t), np.square(s_local.b)
        tiny = np.finfo(s_s.dtype).tiny
        sin2 = (along + across) / np.maximum(s_s, tiny)
        p = (nu * along + nv * across) / np.maximum(along + across, tiny)
        shape = np.exp(p * log_cos(n_h, sin2)) * n_l / (np.maximum(v_h, 1e-9) * np.maximum(n_l, n_v))
        shape *= np.sqrt(nu + 1) * np.sqrt(nv + 1) / (8 * np.pi)
        return (schlick(v_h, channels(n_l, self.specular)) * shape).T


def _rise(cosine: Floats) -> Floats:
    """1 - (1 - cosine / 2)^5, expanded so that it is accurate near the horizon."""
    x = cosine / 2
    return x * (5 - x * (10 - x * (10 - x * (5 - x))))
