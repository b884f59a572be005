"""Cook-Torrance: a rough surface whose facets are mirrors with Fresnel reflectance.

response = n_l * (kd * rho / pi + ks * D G F / (4 n_l n_v))          convention: microfacet, D normalised
response = n_l * (kd * rho / pi + ks * D G F / (pi n_l n_v))         convention: printed, D as printed

D is the facet distribution, F Fresnel's reflectance at the facet, kd + ks = 1. A BRDF times the cosine.
G is the share of facets that are lit and seen. Cook and Torrance have V-shaped grooves; most later work has
Smith's masking, which follows from D:

G = min(1, 2 n_h n_l / v_h, 2 n_h n_v / v_h)                         masking: v_groove
G = 1 / ((1 + Lambda(l)) (1 + Lambda(v)))                            masking: smith
G = 1 / (1 + Lambda(l) + Lambda(v))                                  masking: smith_correlated
Lambda(x) = 1 / (x.n) * integral of D(h) max(0, -x.h) dh

The last form takes into account that high facets are both lit and seen more often. Lambda has a closed form
for Beckmann, GGX and Trowbridge-Reitz; for other distributions it is integrated, which takes longer. With m_y
or alpha_y, Beckmann and GGX are anisotropic; t is the direction of the grain.

With the printed constants, 1 / (m^2 cos^4) and 1 / pi, Beckmann's highlight is exactly four times as bright
and does not conserve energy; the 1 / (4 m^2 cos^4) of other texts with 1 / pi is the microfacet form.

Not followed: G without min(1, ...); Fresnel's g as sqrt(n^2 + c^2) - 1 or with + 1, and with n.l for c; the
colour shift multiplied by F once more; n_l n_v outside of the denominator. Walter's rational fit of
Beckmann's Lambda, with which each G1 is off by up to 0.31 %: it is exact here.

References
----------
Cook, R. L., Torrance, K. E. (1982). A reflectance model for computer graphics. ACM Trans. Graph. 1(1).
Torrance, K. E., Sparrow, E. M. (1967). Theory for off-specular reflection from roughened surfaces. JOSA 57.
Smith, B. G. (1967). Geometrical shadowing of a random rough surface. IEEE Trans. Antennas Propag. 15(5).
Walter, B., et al. (2007). Microfacet models for refraction through rough surfaces. EGSR '07, eq. 20.
Burley, B. (2012). Physically-based shading at Disney. SIGGRAPH 2012 course. D: gtr.
Heitz, E. (2014). Understanding the masking-shadowing function in microfacet-based BRDFs. JCGT 3(2).
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel, Lobe
from illumcli.models._distributions import GGX, Beckmann, Distribution, slopes_with_grain
from illumcli.models._fresnel import Fresnel, Shifted
from illumcli.models._lobes import or_rest, tint, weighted
from illumcli.models._masking import correlated_over_4ab, separable_over_4ab
from illumcli.models._microfacet import vgroove_over_4ab
from illumcli.models._parameters import Varying
from illumcli.models._terms import Angle, Components
from illumcli.schema.description import default_of
from illumcli.schema.fields import Albedo, Share

WHITE = (1.0, 1.0, 1.0)
SMITH_OVER_4AB = {"smith": separable_over_4ab, "smith_correlated": correlated_over_4ab}


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
    masking: Literal["v_groove", "smith", "smith_correlated"] = "v_groove"
    """G, masking and shadowing of facets. `v_groove`: Torrance and Sparrow's grooves, as in the text.
    `smith`: Smith's, each independent of the other. `smith_correlated`: Smith's, correlated by height, as in
    most renderers of today."""
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
        """The lobes that are not black; the specular one in the form that asks for the fewest terms."""
        lobes = super().lobes()
        if "specular" in lobes:
            colored = isinstance(self.fresnel, Shifted) and self.fresnel.grazing == "light"
            if slopes_with_grain(self.distribution) is not None:
                lobes["specular"] = self.colored_grain_lobe if colored else self.grain_lobe
            elif colored:
                lobes["specular"] = self.colored_lobe
        return lobes

    def has_grain(self) -> bool:
        """True if D has different slopes along and across the grain."""
        slopes = slopes_with_grain(self.distribution)
        return slopes is not None and slopes[0] != slopes[1]

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
        D = self.distribution
        if self.masking == "v_groove":
            G_over_4ab = vgroove_over_4ab(n_l, n_v, s_s)
        else:
            G_over_4ab = SMITH_OVER_4AB[self.masking](D.area(n_l), D.area(n_v))
        return self._product(D.density(theta_h, self._is_printed()) * (n_l * G_over_4ab), v_h, light)

    def grain_lobe(
        self, l_local: Components, v_local: Components, s_local: Components, s_s: Floats, v_h: Floats
    ) -> Vectors:
        """(N, 3) the specular lobe of an anisotropic distribution."""
        return self.colored_grain_lobe(l_local, v_local, s_local, s_s, v_h, None)

    def colored_grain_lobe(
        self,
        l_local: Components,
        v_local: Components,
        s_local: Components,
        s_s: Floats,
        v_h: Floats,
        light: Vectors | None,
    ) -> Vectors:
        """(N, 3) the same with a colour that shifts to the light's at grazing."""
        D = self.distribution
        assert isinstance(D, Beckmann | GGX)
        if self.masking == "v_groove":
            G_over_4ab = vgroove_over_4ab(l_local.n, v_local.n, s_s)
        else:
            G_over_4ab = SMITH_OVER_4AB[self.masking](D.grain_area(l_local), D.grain_area(v_local))
        density = D.grain_density(s_local, self._is_printed())
        return self._product(density * (l_local.n * G_over_4ab), v_h, light)

    def _product(self, shape: Floats, v_h: Floats, light: Vectors | None) -> Vectors:
        """(N, 3) ks * F * shape, with the convention's factor."""
        (ks,) = as_dtype_of(v_h, self.specular_weight)
        shape *= ks * (4 / np.pi) if self._is_printed() else ks
        F = self.fresnel.reflectance(v_h, light)
        return tint(WHITE, F * shape) if F.ndim == 1 else (F * shape).T

    def _is_printed(self) -> bool:
        return self.convention == "printed"

    def _diffuse_weight(self) -> Any:
        return or_rest(self.diffuse_weight, self.specular_weight)
