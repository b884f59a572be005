"""Generated: facets that are mirrors, with any distribution of their normals: a formula, a table, a drawing.

response = n_l * (kd * rho / pi + ks * p(h) <h.n> F / (4 g(l) g(v)))

p is the density of facet normals over solid angle, its integral 1; <h.n> = integral of (h.n) p(h) dh, and
g(k) = integral of (h.k)+ p(h) dh. F is Fresnel's reflectance at the facet, kd + ks = 1. The grooves need not
be V-shaped: nothing is assumed but that whether a facet is hidden does not depend on which way it looks.

With D = p / <h.n> and the projected area of facets A(k) = g(k) / <h.n> it is F D G1(l) G1(v) / (4 n_l n_v),
G1(k) = n.k / A(k): Smith's masking, separable, of this very distribution. With Beckmann's or GGX's
formula it is cook_torrance with `masking: smith`.

Where the facets' normals do not add up to the surface's normal, as where all of them lean the same way,
A(k) may be less than n.k: more of the facets would be seen than there are, and more light reflected than is
incident. A(k) is at least n.k here; the paper has no such bound.

p needs no unit: any multiple of it is the same surface. Where a drawing is coloured, its largest channel is p
and its colour that of the facets.

A is tabulated once per distribution, in the leans' own width, and interpolated: without grain to 1e-8, with
one usually to 1e-4 of its value.

References
----------
Ashikhmin, M., Premoze, S., Shirley, P. (2000). A microfacet-based BRDF generator. SIGGRAPH 2000.
Heitz, E. (2014). Understanding the masking-shadowing function in microfacet-based BRDFs. JCGT 3(2).
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal, Self

import numpy as np

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel, Lobe
from illumcli.models._facet_densities import ReadPixels
from illumcli.models._facet_distributions import WORST, FacetDistribution
from illumcli.models._fresnel import Fresnel, Shifted
from illumcli.models._lobes import or_rest, tint, weighted
from illumcli.models._parameters import Varying
from illumcli.models._terms import Angle, Components
from illumcli.schema.description import default_of
from illumcli.schema.fields import Albedo, Share

WHITE = (1.0, 1.0, 1.0)


class Generated(IlluminationModel):
    model: Literal["generated"] = "generated"
    diffuse: Varying[Albedo] = (0.8, 0.8, 0.8)
    """rho, the albedo of the diffuse part."""
    diffuse_weight: Varying[Share] | None = None
    """kd, the share of diffuse reflection; by default 1 - ks."""
    specular_weight: Varying[Share] = 0.5
    """ks, the share of specular reflection."""
    distribution: FacetDistribution = default_of({"p": "formula"})
    """p, the distribution of facet normals."""
    fresnel: Fresnel = default_of({"F": "dielectric"})
    """F, the reflectance of a facet."""

    scales: ClassVar[dict[str, tuple[str, ...]]] = {
        "diffuse_lobe": ("diffuse", "diffuse_weight"),
        "specular_lobe": ("specular_weight",),
    }
    reciprocal: ClassVar[bool] = True
    conserving: ClassVar[bool] = True
    isotropic: ClassVar[bool] = False
    physical: ClassVar[bool] = True

    def has_grain(self) -> bool:
        """True unless the distribution is the same all around the normal."""
        return self.distribution.has_grain()

    def prepared(self, read: ReadPixels) -> Self:
        """This model with its distribution read and tabulated."""
        return self.at({"distribution": self.distribution.microsurface(read)})

    def repairs(self) -> dict[str, int]:
        """Numbers of a file that cannot be densities, and a distribution too fine for its integrals."""
        surface = self.distribution.microsurface(None)
        kinds = {
            "values of distributions that are negative or not finite, taken as 0": surface.mended,
            f"distributions whose masking may be off by more than {WORST:.0%}": surface.is_uncertain,
        }
        return {kind: int(count) for kind, count in kinds.items() if count}

    def lobes(self) -> dict[str, Lobe]:
        """The lobes that are not black; the specular one needs the light's colour only if F does."""
        lobes = super().lobes()
        if "specular" in lobes:
            is_colored = isinstance(self.fresnel, Shifted) and self.fresnel.grazing == "light"
            if self.has_grain():
                lobes["specular"] = self.colored_grained_lobe if is_colored else self.grained_lobe
            elif is_colored:
                lobes["specular"] = self.colored_lobe
        return lobes

    def diffuse_color(self) -> Any:
        """kd * rho."""
        return weighted(self.diffuse, self._diffuse_weight())

    def diffuse_lobe(self, n_l: Floats) -> Vectors:
        """(N, 3) kd * rho / pi * n_l."""
        (kd,) = as_dtype_of(n_l, self._diffuse_weight())
        return tint(self.diffuse, n_l * (kd / np.pi))

    def specular_lobe(self, n_l: Floats, n_v: Floats, v_h: Floats, theta_h: Angle) -> Vectors:
        """(N, 3) ks * D F n_l / (4 A(l) A(v)) of a distribution without grain."""
        return self.colored_lobe(n_l, n_v, v_h, theta_h, None)

    def colored_lobe(
        self, n_l: Floats, n_v: Floats, v_h: Floats, theta_h: Angle, light: Vectors | None
    ) -> Vectors:
        """(N, 3) the same with a colour that shifts to the light's at grazing."""
        surface = self.distribution.microsurface(None)
        sine = np.sqrt(theta_h.sin2)
        D = surface.normalised(np.stack([sine, np.zeros_like(sine), theta_h.cosine]))
        areas = surface.area.of_angle(n_l) * surface.area.of_angle(n_v)
        return self._reflected(D * (n_l / (4 * areas)), v_h, light)

    def grained_lobe(
        self, l_local: Components, v_local: Components, s_local: Components, v_h: Floats
    ) -> Vectors:
        """(N, 3) ks * D F n_l / (4 A(l) A(v)) of a distribution that depends on phi."""
        return self.colored_grained_lobe(l_local, v_local, s_local, v_h, None)

    def colored_grained_lobe(
        self,
        l_local: Components,
        v_local: Components,
        s_local: Components,
        v_h: Floats,
        light: Vectors | None,
    ) -> Vectors:
        """(N, 3) the same with a colour that shifts to the light's at grazing."""
        surface = self.distribution.microsurface(None)
        D = surface.normalised(above(s_local)) * (s_local.n > 0)
        areas = surface.area.of_direction(l_local) * surface.area.of_direction(v_local)
        return self._reflected(D * (l_local.n / (4 * areas)), v_h, light)

    def _reflected(self, shape: Vectors, v_h: Floats, light: Vectors | None) -> Vectors:
        """(N, 3) ks F times (N,) or (3, N) values."""
        (ks,) = as_dtype_of(v_h, self.specular_weight)
        F = self.fresnel.reflectance(v_h, light)
        product = F * (ks * shape)
        return tint(WHITE, product) if product.ndim == 1 else product.T

    def _diffuse_weight(self) -> Any:
        return or_rest(self.diffuse_weight, self.specular_weight)


def above(s: Components) -> Vectors:
    """(3, N) the unit vector along s, its component along the normal at least the machine epsilon."""
    size = np.sqrt(s.t * s.t + s.b * s.b + s.n * s.n)
    limits = np.finfo(size.dtype)
    h = np.stack(s) / np.maximum(size, limits.tiny)
    np.maximum(h[2], limits.eps, out=h[2])
    return h
