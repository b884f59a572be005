"""Metallic-roughness: the material of glTF, a metal and a plastic of one roughness and their mixture.

response = n_l * (metallic * metal + (1 - metallic) * dielectric)
metal      = S (c + (1 - c) w)
dielectric = (1 - f) c / pi + f S,  f = f0 + (1 - f0) w,  f0 = ((ior - 1) / (ior + 1))^2
S = D G / (4 n_l n_v),  w = (1 - v_h)^5,  alpha = roughness^2
D = alpha^2 / (pi (alpha^2 n_h^2 + 1 - n_h^2)^2)
G = 2 n_l n_v / (n_v sqrt(alpha^2 + (1 - alpha^2) n_l^2) + n_l sqrt(alpha^2 + (1 - alpha^2) n_v^2))

c is the base colour. GGX with the height-correlated form of Smith's G, and Schlick's F. A BRDF times the
cosine, reciprocal. The specification's simple mixture takes from the diffuse part what one facet reflects:
at grazing a smooth white plastic reflects more light than is incident, and rough metals lose what is
reflected twice. Ambient light is reflected by the base colour, of metals, too.

Alpha is at least 10^-4, the narrowest lobe that single precision resolves. Not followed: the sample code of
earlier revisions of the specification, which takes the mixture's F from the diffuse part.

References
----------
The Khronos Group (2021). glTF 2.0 specification, 2.0.1, appendix B. ISO/IEC 12113:2022.
Walter, B., et al. (2007). Microfacet models for refraction through rough surfaces. EGSR '07, eq. 33.
Heitz, E. (2014). Understanding the masking-shadowing function in microfacet-based BRDFs. JCGT 3(2), eq. 99.
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel, Lobe
from illumcli.models._fresnel import f0_from_eta, schlick
from illumcli.models._lobes import channels, tint
from illumcli.models._masking import correlated_over_4ab, ggx_area, isotropic_spread2
from illumcli.models._microfacet import ggx
from illumcli.models._parameters import Index, Varying
from illumcli.models._terms import Angle
from illumcli.schema.fields import Albedo, Share

LEAST_ALPHA = 1e-4


class MetallicRoughness(IlluminationModel):
    model: Literal["metallic_roughness"] = "metallic_roughness"
    base_color: Varying[Albedo] = (0.8, 0.8, 0.8)
    """c, the albedo of what is no metal, the reflectance at normal incidence of metal."""
    metallic: Varying[Share] = 0.0
    """The share of metal: 0 plastic, 1 metal."""
    roughness: Varying[Share] = 0.5
    """The root of alpha: 0 a mirror, which shows lights alone, 1 very rough."""
    ior: Varying[Index] = 1.5
    """Index of refraction of what is no metal; 1.5 reflects 4 % at normal incidence."""

    surface_color: ClassVar[str] = "base_color"
    scales: ClassVar[dict[str, tuple[str, ...]]] = {"diffuse_lobe": ("base_color",)}
    reciprocal: ClassVar[bool] = True
    physical: ClassVar[bool] = True

    def lobes(self) -> dict[str, Lobe]:
        """The lobes that are not black: a metal has no diffuse one."""
        lobes = super().lobes()
        if self._is_always("metallic", 1):
            lobes.pop("diffuse", None)
        return lobes

    def diffuse_lobe(self, n_l: Floats, v_h: Floats) -> Vectors:
        """(N, 3) (1 - metallic) (1 - f) c / pi * n_l."""
        metallic, ior = as_dtype_of(n_l, self.metallic, self.ior)
        passed = 1 - schlick(v_h, f0_from_eta(ior))
        return tint(self.base_color, (1 - metallic) * passed * n_l / np.pi)

    def specular_lobe(self, n_l: Floats, n_v: Floats, v_h: Floats, theta_h: Angle) -> Vectors:
        """(N, 3) S times F of the mixture, which is linear in F at normal incidence."""
        metallic, roughness, ior = as_dtype_of(n_l, self.metallic, self.roughness, self.ior)
        alpha = np.maximum(np.square(roughness), n_l.dtype.type(LEAST_ALPHA))
        f0 = (1 - metallic) * f0_from_eta(ior) + metallic * channels(n_l, self.base_color)
        l, v = (ggx_area(cosine, isotropic_spread2(cosine, alpha)) for cosine in (n_l, n_v))
        shape = ggx(*theta_h, alpha) * (correlated_over_4ab(l, v) * n_l)
        return (schlick(v_h, f0) * shape).T
