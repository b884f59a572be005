"""Poulin-Fournier: a surface of parallel grooves with the cross-section of a circle's arc.

response = n_l / (2 sin(theta_s) n_l n_v) * integral over -theta_s..theta_s of f_m <n_psi.l> <n_psi.v> d psi
n_psi = n cos(psi) + b sin(psi)
f_m = kd / pi + ks (e + 2) / (2 pi) <n_psi.h>^e

t runs along the grooves and b = n x t across them; theta_s is the steepest slope, where facets are spread
evenly in psi. A BRDF times the cosine, reciprocal; theta_s -> 0 gives the isotropic f_m. No facet hides
another, so steep grooves reflect more than arrives at grazing across them.

The paper's idea in one concrete form: its cylinders stand side by side, and the sum over the facets that are
lit and seen is taken exactly. The diffuse part is in closed form, the specular one by Gauss-Legendre
quadrature on the part of the arc where the highlight is not negligible.

References
----------
Poulin, P., Fournier, A. (1990). A model for anisotropic reflection. SIGGRAPH '90.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import gauss_legendre, tint
from illumcli.models._parameters import Albedo, NonNegative, Varying

Slope = Varying[Annotated[float, Field(ge=1e-3, le=1.57)]]

NODES = {np.dtype(np.float32): (14, 12.0), np.dtype(np.float64): (64, 40.0)}
"""Per precision: quadrature nodes, and the fall, as an exponent, at which a highlight is negligible."""


class PoulinFournier(IlluminationModel):
    model: Literal["poulin_fournier"] = "poulin_fournier"
    diffuse: Albedo = (0.6, 0.6, 0.6)
    """kd, the diffuse albedo of the facets."""
    specular: Albedo = (0.2, 0.2, 0.2)
    """ks, the share of the facets' highlight."""
    exponent: NonNegative = 32.0
    """e, exponent of the facets' highlight; 0 to 10^6 and beyond."""
    slope: Slope = 0.5
    """theta_s, steepest slope of the grooves [rad]."""

    reciprocal: ClassVar[bool] = True
    isotropic: ClassVar[bool] = False
    physical: ClassVar[bool] = True

    def diffuse_lobe(self, n_l: Floats, n_v: Floats, b_l: Floats, b_v: Floats) -> Vectors:
        """(N, 3) the diffuse part, integrated in closed form."""
        (steepest,) = as_dtype_of(n_l, self.slope)
        low, high = lit_and_seen(n_l, n_v, b_l, b_v, steepest)
        area = facing(n_l, n_v, b_l, b_v, low, high)
        return tint(self.diffuse, area / (2 * np.pi * np.sin(steepest) * n_v))

    def specular_lobe(
        self,
        n_l: Floats,
        n_v: Floats,
        b_l: Floats,
        b_v: Floats,
        s_s: Floats,
        n_s: Floats,
        t_s: Floats,
        b_s: Floats,
    ) -> Vectors:
        """(N, 3) the specular part, by quadrature: to 1e-5 in single precision, 1e-12 in double."""
        e, steepest = as_dtype_of(n_l, self.exponent, self.slope)
        low, high = lit_and_seen(n_l, n_v, b_l, b_v, steepest)
        area = highlight(n_l, n_v, b_l, b_v, s_s, n_s, t_s, b_s, e, low, high)
        return tint(self.specular, area * ((e + 2) / (4 * np.pi * np.sin(steepest))) / n_v)


def lit_and_seen(n_l: Any, n_v: Any, b_l: Any, b_v: Any, steepest: Any) -> tuple[Any, Any]:
    """(low, high) slopes of the facets that face light and eye; equal where there are none."""
    from_light, from_eye = -np.arctan2(n_l, b_l), -np.arctan2(n_v, b_v)
    low = np.maximum(np.maximum(from_light, from_eye), -steepest)
    high = np.minimum(np.minimum(from_light, from_eye) + np.pi, steepest)
    return low, np.maximum(low, high)


def facing(n_l: Any, n_v: Any, b_l: Any, b_v: Any, low: Any, high: Any) -> Any:
    """The integral of (n_psi.l) (n_psi.v) over low..high.

    About the middle of the arc the odd part vanishes, and what is left has no cancellation on narrow arcs.
    """
    width, middle = high - low, (high + low) / 2
    cosine, sine = np.cos(middle), np.sin(middle)
    level = (n_l * cosine + b_l * sine) * (n_v * cosine + b_v * sine)
    slope = (b_l * cosine - n_l * sine) * (b_v * cosine - n_v * sine)
    curve = np.sin(width)
    return np.maximum(level * (width + curve) + slope * _excess(width, curve), 0) / 2


def _excess(x: Any, sine: Any) -> Any:
    """x - sin(x), by its series below 1/2."""
    small = x < 0.5
    x2 = np.square(np.minimum(x, 0.5))
    series = 1.0
    for k in (12, 10, 8, 6, 4):
        series = 1 - series * x2 / (k * (k + 1))
    return x * x2 / 6 * series * small + (x - sine) * ~small


def highlight(
    n_l: Any,
    n_v: Any,
    b_l: Any,
    b_v: Any,
    s_s: Any,
    n_s: Any,
    t_s: Any,
    b_s: Any,
    e: Any,
    low: Any,
    high: Any,
) -> Any:
    """The integral of <n_psi.h>^e (n_psi.l) (n_psi.v) over low..high.

    With u = psi - psi_h, n_psi.h is cos(u) times the length of h across the grooves. Nodes are spread over
    the slopes where cos(u)^e is above its greatest value times exp(-fall).
    """
    nodes, fall = NODES[n_l.dtype]
    limits = np.finfo(n_l.dtype)
    below_one = 1 - 8 * float(limits.eps)
    psi_h = np.arctan2(b_s, n_s)
    nearest = np.sin(np.clip(np.clip(psi_h, low, high) - psi_h, -np.pi / 2, np.pi / 2))
    shrink = -2 * fall / np.maximum(e, 2 * fall / 80)
    reach = np.arcsin(np.sqrt(np.clip(nearest * nearest * np.exp(shrink) - np.expm1(shrink), 0, below_one)))
    first, last = np.clip(low - psi_h, -reach, reach), np.clip(high - psi_h, -reach, reach)
    half, middle = (last - first) / 2, (last + first) / 2

    cos_h, sin_h = np.cos(psi_h), np.sin(psi_h)
    l_h, v_h = n_l * cos_h + b_l * sin_h, n_v * cos_h + b_v * sin_h
    l_x, v_x = b_l * cos_h - n_l * sin_h, b_v * cos_h - n_v * sin_h
    along = np.log1p(-np.minimum(t_s * t_s / np.maximum(s_s, limits.tiny), below_one))

    total, half_e = np.zeros_like(n_l), e / 2
    for node, weight in gauss_legendre(nodes):
        sine = np.sin(middle + half * node)
        sine2 = sine * sine
        cosine = np.sqrt(1 - sine2)
        fade = np.exp((np.log1p(-sine2) + along) * half_e)
        total += fade * weight * (l_h * cosine + l_x * sine) * (v_h * cosine + v_x * sine)
    return np.maximum(total * half, 0)
