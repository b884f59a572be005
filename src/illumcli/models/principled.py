"""Principled: Disney's material, one for metals, plastics, cloth and lacquer, by parameters from 0 to 1.

response = n_l * ((1 - metallic) * (diffuse + F sheen C_sheen) + S + clearcoat / 4 * coat)
diffuse = c / pi * ((1 - subsurface) * (1 + (a - 1) F_l) (1 + (a - 1) F_v) + subsurface * 1.25 *
          ((1 + (b - 1) F_l) (1 + (b - 1) F_v) (1 / (n_l + n_v) - 1/2) + 1/2))
S       = D(ax, ay) g(l, ax, ay) g(v, ax, ay) (C_s + (1 - C_s) F)
coat    = D_1(0.1 - 0.099 gloss) g(l, 1/4, 1/4) g(v, 1/4, 1/4) (0.04 + 0.96 F)
F_l = (1 - n_l)^5,  F_v = (1 - n_v)^5,  F = (1 - l_h)^5,  b = roughness l_h^2,  a = 1/2 + 2 b
ax = roughness^2 / aspect,  ay = roughness^2 aspect,  aspect = sqrt(1 - 0.9 anisotropic)
D   = 1 / (pi ax ay ((h.t)^2 / ax^2 + (h.b)^2 / ay^2 + n_h^2)^2)
D_1(x) = (x^2 - 1) / (pi ln(x^2) (1 + (x^2 - 1) n_h^2))
g(w) = 1 / (n_w + sqrt((ax w.t)^2 + (ay w.b)^2 + n_w^2))
C_s = (1 - metallic) 0.08 specular (1 - specular_tint + specular_tint T) + metallic c
C_sheen = 1 - sheen_tint + sheen_tint T,  T = c / (0.3 c_R + 0.6 c_G + 0.1 c_B)

c is the base colour, F Schlick's, D GTR with the exponent 2, which is GGX, D_1 with 1. g(l) g(v) is Smith's
separable G over 4 n_l n_v. The constant 1.25, and a quarter of a coat that takes nothing from what is below,
are the authors'. A BRDF times the cosine, reciprocal; edges of rough or coated surfaces reflect more light
than is incident. Ambient light is reflected by the base colour, of metals, too.

Paper and the authors' code differ; the code of 2015 is followed: G of the base has the width of D in both
directions, where the paper has (1/2 + roughness / 2)^2 in all; ax and ay are at least 0.001. Both have 1/4
for the width of the coat's G, whatever its gloss. The code takes sRGB for c, here it is linear.

References
----------
Burley, B. (2012). Physically-based shading at Disney. SIGGRAPH '12 course notes, sections 5.3 to 5.6.
Walt Disney Animation Studios (2015). BRDF Explorer, disney.brdf. https://github.com/wdas/brdf
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel, Lobe
from illumcli.models._fresnel import Array, schlick
from illumcli.models._lobes import channels, fifth
from illumcli.models._masking import anisotropic_spread2, ggx_area, separable_over_4ab
from illumcli.models._microfacet import anisotropic_ggx, squared_unit
from illumcli.models._parameters import Varying
from illumcli.models._terms import Components
from illumcli.schema.fields import Albedo, Share

LEAST_ALPHA = 1e-3
COAT_F0 = 0.04
COAT_MASKING = 0.25


class Principled(IlluminationModel):
    model: Literal["principled"] = "principled"
    base_color: Varying[Albedo] = (0.8, 0.8, 0.8)
    """c, the colour of the surface, linear."""
    subsurface: Varying[Share] = 0.0
    """Share of a diffuse part that is flat as of skin or marble: 0 none, 1 all."""
    metallic: Varying[Share] = 0.0
    """0 dielectric, with a diffuse part under an untinted highlight; 1 metal, all of the base colour."""
    specular: Varying[Share] = 0.5
    """Strength of the highlight of what is no metal, in place of an index: 0.5 reflects 4 % (an index of
    1.5), 1 8 % (1.8)."""
    specular_tint: Varying[Share] = 0.0
    """Tints that highlight with the base colour's hue, but not at grazing."""
    roughness: Varying[Share] = 0.5
    """Of the diffuse part and the highlight, the root of alpha."""
    anisotropic: Varying[Share] = 0.0
    """0 a round highlight, 1 ten times as long along the grain as across it: the paper's X, which lies across
    the scratches of brushed metal."""
    sheen: Varying[Share] = 0.0
    """Light at grazing, for cloth."""
    sheen_tint: Varying[Share] = 0.5
    """Tints it with the base colour's hue."""
    clearcoat: Varying[Share] = 0.0
    """Strength of a second highlight, of a clear lacquer."""
    clearcoat_gloss: Varying[Share] = 1.0
    """0 satin, 1 gloss."""

    surface_color: ClassVar[str] = "base_color"
    scales: ClassVar[dict[str, tuple[str, ...]]] = {}
    reciprocal: ClassVar[bool] = True
    isotropic: ClassVar[bool] = False
    physical: ClassVar[bool] = True

    def has_grain(self) -> bool:
        """True unless the highlight is round."""
        return self.anisotropic != 0

    def lobes(self) -> dict[str, Lobe]:
        """The lobes that are not black: neither metals, nor black surfaces without sheen, have a diffuse
        one."""
        lobes = super().lobes()
        is_black = self._is_always("base_color", 0) and self._is_always("sheen", 0)
        if is_black or self._is_always("metallic", 1):
            del lobes["diffuse"]
        return lobes

    def diffuse_lobe(self, n_l: Floats, n_v: Floats, v_h: Floats) -> Vectors:
        """(N, 3) (1 - metallic) (diffuse + F sheen C_sheen) n_l."""
        metallic, roughness, subsurface, sheen, sheen_tint = as_dtype_of(
            n_l, self.metallic, self.roughness, self.subsurface, self.sheen, self.sheen_tint
        )
        c, rest = channels(n_l, self.base_color), (1 - metallic) * n_l
        F_l, F_v = fifth(1 - n_l), fifth(1 - n_v)
        b = roughness * np.square(v_h)
        plain = (1 + (2 * b - 0.5) * F_l) * (1 + (2 * b - 0.5) * F_v)
        flat = 1.25 * ((1 + (b - 1) * F_l) * (1 + (b - 1) * F_v) * (1 / (n_l + n_v) - 0.5) + 0.5)
        shape = rest * ((1 - subsurface) * plain + subsurface * flat) / np.pi
        return (c * shape + _tinted(c, sheen_tint) * (sheen * fifth(1 - v_h) * rest)).T

    def specular_lobe(
        self, v_h: Floats, s_local: Components, l_local: Components, v_local: Components
    ) -> Vectors:
        """(N, 3) (S + clearcoat / 4 * coat) n_l."""
        h = squared_unit(s_local)

        # The base.
        metallic, roughness, specular, tint, anisotropic = as_dtype_of(
            v_h, self.metallic, self.roughness, self.specular, self.specular_tint, self.anisotropic
        )
        aspect = np.sqrt(1 - v_h.dtype.type(0.9) * anisotropic)
        least = v_h.dtype.type(LEAST_ALPHA)
        ax = np.maximum(np.square(roughness) / aspect, least)
        ay = np.maximum(np.square(roughness) * aspect, least)
        c = channels(v_h, self.base_color)
        f0 = (1 - metallic) * (0.08 * specular) * _tinted(c, tint) + metallic * c
        base = anisotropic_ggx(h, ax, ay) * _masking(l_local, v_local, ax, ay)

        # The coat.
        clearcoat, gloss, width = as_dtype_of(v_h, self.clearcoat, self.clearcoat_gloss, COAT_MASKING)
        coat = _gtr1(h, 0.1 - v_h.dtype.type(0.099) * gloss) * _masking(l_local, v_local, width, width)
        coat *= clearcoat / 4 * schlick(v_h, np.asarray(COAT_F0, v_h.dtype))
        return ((schlick(v_h, f0) * base + coat) * l_local.n).T


def _tinted(c: Array, share: Array) -> Array:
    """(3, N) white with this share of the hue of a colour, whose luminance is 1; black has none."""
    luminance = c[0] * 3 + c[1] * 6 + c[2]
    is_dark = luminance == 0
    hue = c * (10 / (luminance + is_dark)) + is_dark
    return (1 - share) + share * hue


def _gtr1(h: Components, width: Floats) -> Floats:
    """(N,) D_1, normalised; h as by `squared_unit`."""
    width2 = np.square(width)
    return (width2 - 1) / (np.pi * np.log(width2) * (h.t + h.b + width2 * h.n))


def _masking(l: Components, v: Components, ax: Floats, ay: Floats) -> Floats:
    """(N,) g(l) g(v)."""
    return separable_over_4ab(*(ggx_area(w.n, anisotropic_spread2(w.t, w.b, ax, ay)) for w in (l, v)))
