"""Blinn-Phong: a lobe around the half vector.

response = kd * n_l + ks * n_h**e                                    as published (the default)
response = n_l * (kd / pi + ks * C * n_h**e)                         with `normalised: true`
C = (e + 2) (e + 4) / (8 pi (e + 2**(-e/2)))

The published form is an intensity model: cosine included in the diffuse term, no 1/pi, no cosine on the
highlight; not reciprocal. The normalised form is reciprocal, and its highlight reflects exactly ks at normal
incidence. Near the plane of incidence an exponent of about 4 e matches Phong's e; the angle between n and h
is at least half the one between r and v, equal only where n, l and v share a plane.

The half vector is normalized; with the (l + v) / 2 of some texts n.h is too small.

References
----------
Blinn, J. F. (1977). Models of light reflection for computer synthesized pictures. SIGGRAPH '77.
Giesen, F. (2009). Phong and Blinn-Phong normalization factors. The integral at normal incidence.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import lobe, tint
from illumcli.models._parameters import Varying
from illumcli.schema.fields import Color, NonNegative


class BlinnPhong(IlluminationModel):
    model: Literal["blinn_phong"] = "blinn_phong"
    diffuse: Varying[Color] = (0.8, 0.8, 0.8)
    """kd, the diffuse share."""
    specular: Varying[Color] = (0.2, 0.2, 0.2)
    """ks, the share of the highlight."""
    exponent: Varying[NonNegative] = 32.0
    """e, 0 to 10^6 and beyond: the larger, the smaller the highlight."""
    normalised: bool = False
    """Divide each lobe by its integral at normal incidence and multiply it by the cosine."""

    def diffuse_lobe(self, n_l: Floats) -> Vectors:
        """(N, 3) kd * n_l; divided by pi if normalised."""
        return tint(self.diffuse, n_l / np.pi if self.normalised else n_l)

    def specular_lobe(self, n_l: Floats, gap_nh: Floats) -> Vectors:
        """(N, 3) ks * n_h**e, from gap_nh = 1 - n.h."""
        (e,) = as_dtype_of(gap_nh, self.exponent)
        shape = lobe(gap_nh, e)
        if self.normalised:
            shape *= n_l * ((e + 2) / (8 * np.pi) * ((e + 4) / (e + np.exp2(-e / 2))))
        return tint(self.specular, shape)
