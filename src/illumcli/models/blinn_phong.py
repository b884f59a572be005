"""Blinn-Phong: a lobe around the half vector.

response = kd * n_l + ks * n_h**e          as published: cosine included, no 1/pi, no cosine on the lobe

An intensity model: not reciprocal. Near the plane of incidence an exponent of about 4 e matches Phong's e.

References
----------
Blinn, J. F. (1977). Models of light reflection for computer synthesized pictures. SIGGRAPH '77.
"""

from __future__ import annotations

from typing import Literal

from illumcli.arrays import Lanes, Vectors, like
from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import lobe
from illumcli.models._parameters import Color, NonNegative


class BlinnPhong(IlluminationModel):
    model: Literal["blinn_phong"] = "blinn_phong"
    diffuse: Color = (0.8, 0.8, 0.8)
    """kd."""
    specular: Color = (0.2, 0.2, 0.2)
    """ks."""
    exponent: NonNegative = 32.0
    """e, 0 to 10^6 and beyond."""

    def diffuse_lobe(self, n_l: Lanes) -> Vectors:
        """(N, 3) kd * n_l."""
        (kd,) = like(n_l, self.diffuse)
        return kd * n_l[:, None]

    def specular_lobe(self, gap_nh: Lanes) -> Vectors:
        """(N, 3) ks * n_h**e, from gap_nh = 1 - n.h."""
        ks, e = like(gap_nh, self.specular, self.exponent)
        return ks * lobe(gap_nh, e)[:, None]
