"""Strauss: a model with intuitive parameters: colour, smoothness, metalness and transparency.

response = n_l * r_d * d * c + r_s * c_s
r_d = (1 - s^3) (1 - t),  d = 1 - m s,  r_n = (1 - t) s^3
r_s = max(0, r.v)^(3 / (1 - s)) * min(1, r_n + (r_n + k_j) F(x_i) G(x_i) G(x_r))
c_s = 1 + m (1 - F(x_i)) (c - 1)

x_i and x_r are the angles of light and eye to the normal over pi / 2; with angles in radians the pole of F,
at 1.12, would be inside the range. F approximates Fresnel's law, G masking:

F(x) = (1 / (x - k_f)^2 - 1 / k_f^2) / (1 / (1 - k_f)^2 - 1 / k_f^2)
G(x) = (1 / (1 - k_g)^2 - 1 / (x - k_g)^2) / (1 / (1 - k_g)^2 - 1 / k_g^2)

An intensity model: cosine included, not reciprocal. Ambient light is reflected by r_d * c. At s = 1 the
highlight is a perfect mirror reflection, visible only where r equals v within rounding.

Not followed: one text's exponent 3 / (1.0001 - s), F of the mean of both angles and unclamped base.

References
----------
Strauss, P. S. (1990). A realistic lighting model for computer animators. IEEE CG&A 10(6).
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import channels, lobe, tint, weighted
from illumcli.models._parameters import Varying
from illumcli.schema.fields import Albedo, Share

Offset = Annotated[float, Field(ge=1.001, le=10)]


def strauss_fresnel(x: Floats, kf: Floats | float) -> Floats:
    """F(x), 0 at normal incidence and 1 at grazing."""
    return x * (2 * kf - x) * np.square((kf - 1) / (kf - x)) / (2 * kf - 1)


def strauss_geometry(rise: Floats, kg: Floats | float) -> Floats:
    """G(x), 1 at normal incidence and 0 at grazing, from rise = 1 - x."""
    pole = (kg - 1) + rise
    return rise * (2 * (kg - 1) + rise) * np.square(kg / pole) / (2 * kg - 1)


class Surface(NamedTuple):
    """Parameters of the highlight, in the precision of the terms."""

    s: Floats
    """Smoothness."""
    t: Floats
    """Transparency."""
    kj: Floats | float
    """k_j."""
    kf: Floats | float
    """k_f."""
    kg: Floats | float
    """k_g."""


class Strauss(IlluminationModel):
    model: Literal["strauss"] = "strauss"
    color: Varying[Albedo] = (0.8, 0.8, 0.8)
    """c, colour of the surface."""
    smoothness: Varying[Share] = 0.5
    """s: 0 perfectly diffuse, 1 a perfect mirror."""
    metalness: Varying[Share] = 0.0
    """m: 0 highlights of the light's colour, 1 of the surface's."""
    transparency: Varying[Share] = 0.0
    """t: 0 opaque, 1 only the highlight at grazing is reflected."""
    kj: Annotated[float, Field(ge=0, le=1)] = 0.1
    """k_j, strength of the off-specular peak of rough surfaces at grazing."""
    kf: Offset = 1.12
    """k_f, pole of F; the nearer to 1, the later F rises."""
    kg: Offset = 1.01
    """k_g, pole of G; the nearer to 1, the later G falls."""

    surface_color: ClassVar[str] = "color"
    scales: ClassVar[dict[str, tuple[str, ...]]] = {"diffuse_lobe": ("color",)}

    def diffuse_color(self) -> Any:
        """r_d * c, which reflects ambient light."""
        if any(
            not isinstance(each, float | int | np.ndarray) for each in (self.smoothness, self.transparency)
        ):
            return self.color
        s, t = np.asarray(self.smoothness), np.asarray(self.transparency)
        return weighted(self.color, _diffuse_share(s, t))

    def diffuse_lobe(self, n_l: Floats) -> Vectors:
        """(N, 3) n_l * r_d * d * c."""
        s, m, t = as_dtype_of(n_l, self.smoothness, self.metalness, self.transparency)
        return tint(self.color, n_l * (_diffuse_share(s, t) * (1 - m * s)))

    def specular_lobe(
        self, n_l: Floats, n_v: Floats, sin_l: Floats, sin_v: Floats, gap_rv: Floats
    ) -> Vectors:
        """(N, 3) r_s * c_s."""
        s, m, t = as_dtype_of(n_l, self.smoothness, self.metalness, self.transparency)
        surface = Surface(s, t, self.kj, self.kf, self.kg)
        highlight = strauss_specular(n_l, n_v, sin_l, sin_v, gap_rv, surface)
        metal = m * (1 - highlight.F)
        return ((1 + metal * (channels(n_l, self.color) - 1)) * highlight.r_s).T


class Highlight(NamedTuple):
    """The reflectance of the highlight and its factors, (N,) each."""

    F: Floats
    """F(x_i)."""
    G_l: Floats
    """G(x_i)."""
    G_v: Floats
    """G(x_r)."""
    r_j: Floats
    """The factor that does not depend on the angle to the mirror direction."""
    r_s: Floats
    """The reflectance."""


def strauss_specular(
    n_l: Floats, n_v: Floats, sin_l: Floats, sin_v: Floats, gap_rv: Floats, surface: Surface
) -> Highlight:
    """The reflectance r_s of the highlight, and its factors.

    Near s = 1 the exponent is bounded by the rounding of |r - v|^2: a mirror.
    """
    s, t, kj, kf, kg = surface
    rise_l = np.arctan2(n_l, sin_l) * (2 / np.pi)
    rise_v = np.arctan2(n_v, sin_v) * (2 / np.pi)
    F, G_l, G_v = strauss_fresnel(1 - rise_l, kf), strauss_geometry(rise_l, kg), strauss_geometry(rise_v, kg)
    r_n = (1 - t) * s * s * s
    r_j = np.minimum(r_n + (r_n + kj) * (F * G_l * G_v), 1)
    exponent = 3 / np.maximum(1 - s, np.finfo(gap_rv.dtype).eps)
    return Highlight(F, G_l, G_v, r_j, lobe(gap_rv, exponent) * r_j)


def _diffuse_share(s: Floats, t: Floats) -> Floats:
    """r_d = (1 - s^3) (1 - t)."""
    return (1 - s) * (1 + s + s * s) * (1 - t)
