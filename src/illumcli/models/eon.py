"""EON, the energy-preserving Oren-Nayar model: Fujii's form, and the light that it loses between the facets.

response = n_l * (f1 + f2)
f1 = rho / pi * A (1 + r s / t)                                           one bounce, as in `fujii`
f2 = rho' / pi * (1 - E(n_l)) (1 - E(n_v)) / (1 - <E>)                    more bounces
rho' = rho^2 <E> / (1 - rho (1 - <E>))
A = 1 / (1 + (1/2 - 2 / (3 pi)) r)

E is the share of light that f1 reflects from a direction if rho = 1, and <E> its average over all directions:

E(cos) = A (1 + r G / pi);  <E> = A (1 + (2/3 - 28 / (15 pi)) r)
G = sin (theta - sin cos) + 2/3 (sin / cos (1 - sin^3) - sin)

A BRDF times the cosine, reciprocal. A white surface reflects all light from any direction: its albedo is 1 to
rounding. rho is the albedo of a single bounce; light that bounces between the facets is coloured more, so
that the whole surface is darker and more saturated than rho.

E is computed in closed form, not by the authors' polynomial, which is up to 0.0005 off. 1 - E is computed as
A r / pi times a form in which nothing cancels, at grazing or for small r, so that no factor is clamped.

References
----------
Portsmouth, J., Kutz, P., Hill, S. (2025). EON: a practical energy-preserving rough diffuse BRDF. Journal of
Computer Graphics Techniques 14(1).
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import channels, flattening
from illumcli.models._parameters import Varying
from illumcli.schema.fields import Albedo, Share

A_SLOPE = 1 / 2 - 2 / (3 * np.pi)
"""(1 / A - 1) / r, and G / pi at grazing."""
MEAN_SLOPE = 2 / 3 - 28 / (15 * np.pi)
"""(<E> / A - 1) / r."""


def loss(cosine: Floats, sine: Floats) -> Floats:
    """(N,) (1 - E) / (A r) = A_SLOPE - G / pi, the light that f1 loses; 0 at grazing, 0.288 at the normal."""
    rise = np.square(cosine) / (1 + sine)  # 1 - sine
    height = np.arctan2(cosine, sine)  # pi/2 - theta
    cut = 2 / 3 * sine * cosine * (1 + sine + np.square(sine)) / (1 + sine)
    return ((np.pi / 2 - 2 / 3) * rise + sine * (height + sine * cosine) - cut) / np.pi


class Eon(IlluminationModel):
    model: Literal["eon"] = "eon"
    diffuse: Varying[Albedo] = (0.8, 0.8, 0.8)
    """rho, the albedo of a single bounce."""
    roughness: Varying[Share] = 0.5
    """r: 0 is Lambert, 1 the flattest; up to 0.3 within 5 % (RMS) of Oren-Nayar with sigma = r rad."""

    reciprocal: ClassVar[bool] = True
    conserving: ClassVar[bool] = True
    physical: ClassVar[bool] = True

    def diffuse_lobe(self, n_l: Floats, n_v: Floats, l_v: Floats, sin_l: Floats, sin_v: Floats) -> Vectors:
        """(N, 3) n_l * (f1 + f2)."""
        (r,) = as_dtype_of(n_l, self.roughness)
        rho = channels(n_l, self.diffuse)
        A = 1 / (1 + A_SLOPE * r)
        mean = A * (1 + MEAN_SLOPE * r)
        single = 1 + r * flattening(n_l, n_v, l_v)
        several = r * loss(n_l, sin_l) * loss(n_v, sin_v) / (A_SLOPE - MEAN_SLOPE)
        rho_several = np.square(rho) * mean / (1 - rho * (1 - mean))
        return ((rho * single + rho_several * several) * (A * n_l / np.pi)).T
