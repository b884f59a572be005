"""Poulin-Fournier: a surface of parallel grooves with the cross-section of a circle's arc.

response = n_l / (2 sin(theta_s) n_l n_v) * integral over -theta_s..theta_s of f_m <n_psi.l> <n_psi.v> d psi
n_psi = n cos(psi) + b sin(psi)
f_m = kd / pi + ks (e + 2) / (2 pi) <n_psi.h>^e

t is along the grooves and b = n x t across them; theta_s is the steepest slope, and facets are distributed
uniformly in psi. A BRDF times the cosine, reciprocal; theta_s -> 0 gives the isotropic f_m. Facets do not
shadow each other, so at grazing across steep grooves more light is reflected than is incident.

One concrete form of the paper's model: its cylinders are side by side, and the sum over the facets that are
lit and visible is exact. The diffuse part is in closed form, the specular part by Gauss-Legendre quadrature
over the part of the arc where the highlight is not negligible.

References
----------
Poulin, P., Fournier, A. (1990). A model for anisotropic reflection. SIGGRAPH '90.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, NamedTuple

import numpy as np
from pydantic import Field

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import gauss_legendre, tint
from illumcli.models._parameters import Varying
from illumcli.models._terms import Components
from illumcli.schema.fields import Albedo, NonNegative

Slope = Annotated[float, Field(ge=1e-3, le=1.57)]

NODES = {np.dtype(np.float32): (14, 12.0), np.dtype(np.float64): (64, 40.0)}
"""By precision: the number of quadrature nodes, and f such that a highlight below exp(-f) is negligible."""


class PoulinFournier(IlluminationModel):
    model: Literal["poulin_fournier"] = "poulin_fournier"
    diffuse: Varying[Albedo] = (0.6, 0.6, 0.6)
    """kd, the diffuse albedo of the facets."""
    specular: Varying[Albedo] = (0.2, 0.2, 0.2)
    """ks, the share of the facets' highlight."""
    exponent: Varying[NonNegative] = 32.0
    """e, exponent of the facets' highlight; 0 to 10^6 and beyond."""
    slope: Varying[Slope] = 0.5
    """theta_s, steepest slope of the grooves [rad]."""

    reciprocal: ClassVar[bool] = True
    isotropic: ClassVar[bool] = False
    physical: ClassVar[bool] = True

    def diffuse_lobe(self, n_l: Floats, n_v: Floats, b_l: Floats, b_v: Floats) -> Vectors:
        """(N, 3) the diffuse part, integrated in closed form."""
        (steepest,) = as_dtype_of(n_l, self.slope)
        l, v = Across(n_l, b_l), Across(n_v, b_v)
        area = facing(l, v, lit_and_seen(l, v, steepest))
        return tint(self.diffuse, area / (2 * np.pi * np.sin(steepest) * n_v))

    def specular_lobe(
        self, n_l: Floats, n_v: Floats, b_l: Floats, b_v: Floats, s_s: Floats, s_local: Components
    ) -> Vectors:
        """(N, 3) the specular part, by quadrature: to 1e-5 in single precision, 1e-12 in double."""
        e, steepest = as_dtype_of(n_l, self.exponent, self.slope)
        l, v = Across(n_l, b_l), Across(n_v, b_v)
        area = highlight(l, v, s_s, s_local, e, lit_and_seen(l, v, steepest))
        return tint(self.specular, area * ((e + 2) / (4 * np.pi * np.sin(steepest))) / n_v)


class Across(NamedTuple):
    """The components of a direction in the plane across the grooves."""

    n: Floats
    """(N,) along the normal."""
    b: Floats
    """(N,) along b."""

    def turned(self, cosine: Floats, sine: Floats) -> Across:
        """The same direction by its components along n_psi and across it; `cosine` and `sine` are of psi."""
        return Across(self.n * cosine + self.b * sine, self.b * cosine - self.n * sine)


class Arc(NamedTuple):
    """Slopes of facets [rad]."""

    low: Floats
    """(N,)."""
    high: Floats
    """(N,); equal to `low` if there are none."""


def lit_and_seen(l: Across, v: Across, steepest: Floats) -> Arc:
    """The slopes of the facets that face both light and eye."""
    from_light, from_eye = -np.arctan2(l.n, l.b), -np.arctan2(v.n, v.b)
    low = np.maximum(np.maximum(from_light, from_eye), -steepest)
    high = np.minimum(np.minimum(from_light, from_eye) + np.pi, steepest)
    return Arc(low, np.maximum(low, high))


def facing(l: Across, v: Across, arc: Arc) -> Floats:
    """The integral of (n_psi.l) (n_psi.v) over the arc.

    Expanded about the middle of the arc, where odd terms vanish; so narrow arcs have no cancellation.
    """
    low, high = arc
    width, middle = high - low, (high + low) / 2
    cosine, sine = np.cos(middle), np.sin(middle)
    l, v = l.turned(cosine, sine), v.turned(cosine, sine)
    level, slope = l.n * v.n, l.b * v.b
    curve = np.sin(width)
    return np.maximum(level * (width + curve) + slope * _excess(width, curve), 0) / 2


def _excess(x: Floats, sine: Floats) -> Floats:
    """x - sin(x), by its series below 1/2."""
    small = x < 0.5
    x2 = np.square(np.minimum(x, 0.5))
    series: Floats | float = 1.0
    for k in (12, 10, 8, 6, 4):
        series = 1 - series * x2 / (k * (k + 1))
    return x * x2 / 6 * series * small + (x - sine) * ~small


def highlight(l: Across, v: Across, s_s: Floats, s: Components, e: Floats, arc: Arc) -> Floats:
    """The integral of <n_psi.h>^e (n_psi.l) (n_psi.v) over the arc.

    With u = psi - psi_h, n_psi.h is cos(u) times the length of h across the grooves. The quadrature covers
    the slopes where cos(u)^e is above its greatest value times exp(-f), f of `NODES`.
    """
    t_s, b_s, n_s = s
    nodes, fall = NODES[l.n.dtype]
    limits = np.finfo(l.n.dtype)
    below_one = 1 - 8 * float(limits.eps)

    # The part of the arc where the highlight is not negligible, as slopes relative to that of h.
    psi_h = np.arctan2(b_s, n_s)
    low, high = arc
    nearest = np.sin(np.clip(np.clip(psi_h, low, high) - psi_h, -np.pi / 2, np.pi / 2))
    shrink = -2 * fall / np.maximum(e, 2 * fall / 80)
    reach = np.arcsin(np.sqrt(np.clip(nearest * nearest * np.exp(shrink) - np.expm1(shrink), 0, below_one)))
    first, last = np.clip(low - psi_h, -reach, reach), np.clip(high - psi_h, -reach, reach)
    half, middle = (last - first) / 2, (last + first) / 2

    # Light and eye in the frame of the facet that faces h, and the logarithm of h's squared length across.
    cos_h, sin_h = np.cos(psi_h), np.sin(psi_h)
    l_h, v_h = l.turned(cos_h, sin_h), v.turned(cos_h, sin_h)
    along = np.log1p(-np.minimum(t_s * t_s / np.maximum(s_s, limits.tiny), below_one))

    # Gauss-Legendre quadrature over that part.
    total, half_e = np.zeros_like(l.n), e / 2
    for node, weight in gauss_legendre(nodes):
        sine = np.sin(middle + half * node)
        sine2 = sine * sine
        cosine = np.sqrt(1 - sine2)
        fade = np.exp((np.log1p(-sine2) + along) * half_e)
        total += fade * weight * (l_h.n * cosine + l_h.b * sine) * (v_h.n * cosine + v_h.b * sine)
    return np.maximum(total * half, 0)
