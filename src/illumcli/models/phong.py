"""Phong: a lobe around the mirrored light, as Phong wrote it.

response = kd * n_l + ks * r_v**e                                    as published (the default)
response = n_l * (kd / pi + ks * (e + 2) / (2 pi) * r_v**e)          with `normalised: true`

The published form is an intensity model: the cosine is included in its diffuse term, there is no 1/pi, the
highlight has no cosine. It is not reciprocal, and no energy balance follows from kd + ks <= 1. The normalised
form is a BRDF times the cosine: reciprocal, and reflects at most kd + ks.

The cosine is clamped before the power; texts that print max(0, cos**e) light the wrong side for an even e.

References
----------
Phong, B. T. (1975). Illumination for computer generated pictures. Communications of the ACM 18(6).
Lewis, R. R. (1994). Making shaders more physically plausible. Computer Graphics Forum 13(2).
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import lobe, tint
from illumcli.models._parameters import Varying
from illumcli.schema.fields import Color, NonNegative


class Phong(IlluminationModel):
    model: Literal["phong"] = "phong"
    diffuse: Varying[Color] = (0.8, 0.8, 0.8)
    """kd, the diffuse share."""
    specular: Varying[Color] = (0.2, 0.2, 0.2)
    """ks, the share of the highlight."""
    exponent: Varying[NonNegative] = 32.0
    """e, 0 to 10^6 and beyond: the larger, the smaller the highlight."""
    normalised: bool = False
    """Divide each lobe by its integral and multiply it by the cosine (Lewis 1994)."""

    def diffuse_lobe(self, n_l: Floats) -> Vectors:
        """(N, 3) kd * n_l; divided by pi if normalised."""
        return tint(self.diffuse, n_l / np.pi if self.normalised else n_l)

    def specular_lobe(self, n_l: Floats, gap_rv: Floats) -> Vectors:
        """(N, 3) ks * r_v**e, from gap_rv = 1 - r.v."""
        (e,) = as_dtype_of(gap_rv, self.exponent)
        shape = lobe(gap_rv, e)
        return tint(self.specular, shape * n_l * ((e + 2) / (2 * np.pi)) if self.normalised else shape)
