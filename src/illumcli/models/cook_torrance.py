"""Cook-Torrance: a rough surface of V-shaped grooves whose facets are mirrors with Fresnel reflectance.

response = n_l * (kd * rho / pi + ks * D G F / (4 n_l n_v))          convention: microfacet, D normalised
response = n_l * (kd * rho / pi + ks * D G F / (pi n_l n_v))         convention: printed, D as printed

D is the facet distribution, G the V-groove term, F Fresnel's reflectance at the facet, kd + ks = 1. A BRDF
times the cosine. With the printed constants, 1 / (m^2 cos^4) and 1 / pi, Beckmann's highlight is exactly four
times as bright and does not conserve energy; the 1 / (4 m^2 cos^4) of other texts with 1 / pi is the
microfacet form.

Not followed: G without min(1, ...); Fresnel's g as sqrt(n^2 + c^2) - 1 or with + 1, and with n.l for c; the
colour shift multiplied by F once more; n_l n_v outside of the denominator.

References
----------
Cook, R. L., Torrance, K. E. (1982). A reflectance model for computer graphics. ACM Trans. Graph. 1(1).
Torrance, K. E., Sparrow, E. M. (1967). Theory for off-specular reflection from roughened surfaces. JOSA 57.
Walter, B., et al. (2007). Microfacet models for refraction through rough surfaces. EGSR '07, eq. 20.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel, Lobe
from illumcli.models._fresnel import Fresnel, Shifted
from illumcli.models._lobes import tint, weighted
from illumcli.models._microfacet import Distribution, vgroove_over_4ab
from illumcli.models._parameters import Varying
from illumcli.models._terms import Angle
from illumcli.schema.description import Description, default_of
from illumcli.schema.fields import Albedo, Share

WHITE = (1.0, 1.0, 1.0)


class CookTorrance(IlluminationModel):
    model: Literal["cook_torrance"] = "cook_torrance"
    diffuse: Varying[Albedo] = (0.8, 0.8, 0.8)
    """rho, the albedo of the diffuse part."""
    diffuse_weight: Varying[Share] | None = None
    """kd, the share of diffuse reflection; by default 1 - ks."""
    specular_weight: Varying[Share] = 0.5
    """ks, the share of specular reflection."""
    distribution: Distribution = default_of({"D": "beckmann"})
    """D, the distribution of facet normals."""
    fresnel: Fresnel = default_of({"F": "dielectric"})
    """F, the reflectance of a facet."""
    convention: Literal["microfacet", "printed"] = "microfacet"
    """Constants. `microfacet`: a normalised D over 4 n_l n_v. `printed`: D as printed in texts over
    pi n_l n_v."""

    scales: ClassVar[dict[str, tuple[str, ...]]] = {
        "diffuse_lobe": ("diffuse", "diffuse_weight"),
        "specular_lobe": ("specular_weight",),
    }
    reciprocal: ClassVar[bool] = True
    conserving: ClassVar[bool] = True
    physical: ClassVar[bool] = True

    def lobes(self) -> dict[str, Lobe]:
        """The lobes that are not black; the specular one needs the light's colour only if F does."""
        lobes = super().lobes()
        if "specular" in lobes and isinstance(self.fresnel, Shifted) and self.fresnel.grazing == "light":
            lobes["specular"] = self.colored_lobe
        return lobes

    def diffuse_color(self) -> Any:
        """kd * rho."""
        return weighted(self.diffuse, self._diffuse_weight())

    def diffuse_lobe(self, n_l: Floats) -> Vectors:
        """(N, 3) kd * rho / pi * n_l."""
        (kd,) = as_dtype_of(n_l, self._diffuse_weight())
        return tint(self.diffuse, n_l * (kd / np.pi))

    def specular_lobe(self, n_l: Floats, n_v: Floats, s_s: Floats, v_h: Floats, theta_h: Angle) -> Vectors:
        """(N, 3) ks * D G F / (4 n_v)."""
        return self.colored_lobe(n_l, n_v, s_s, v_h, theta_h, None)

    def colored_lobe(
        self,
        n_l: Floats,
        n_v: Floats,
        s_s: Floats,
        v_h: Floats,
        theta_h: Angle,
        light: Vectors | None,
    ) -> Vectors:
        """(N, 3) the specular lobe with a colour that shifts to the light's at grazing."""
        printed = self.convention == "printed"
        (ks,) = as_dtype_of(n_l, self.specular_weight)
        shape = self.distribution.density(theta_h, printed) * (n_l * vgroove_over_4ab(n_l, n_v, s_s))
        shape *= ks * (4 / np.pi) if printed else ks
        F = self.fresnel.reflectance(v_h, light)
        return tint(WHITE, F * shape) if F.ndim == 1 else (F * shape).T

    def _diffuse_weight(self) -> Any:
        if self.diffuse_weight is not None:
            return self.diffuse_weight
        ks = self.specular_weight
        return ks if isinstance(ks, Description) else 1 - np.asarray(ks)
