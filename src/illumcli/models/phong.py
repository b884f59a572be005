"""Phong: a lobe around the mirrored light, as Phong wrote it.

response = kd * n_l + ks * r_v**e          cosine included, no 1/pi, no cosine on the lobe

An intensity model: not reciprocal, and no energy balance follows from kd + ks <= 1.

References
----------
Phong, B. T. (1975). Illumination for computer generated pictures. Communications of the ACM 18(6).
"""

from __future__ import annotations

from typing import Literal

from illumcli.arrays import Lanes, Vectors, like
from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import lobe
from illumcli.models._parameters import Color, NonNegative


class Phong(IlluminationModel):
    model: Literal["phong"] = "phong"
    diffuse: Color = (0.8, 0.8, 0.8)
    """kd."""
    specular: Color = (0.2, 0.2, 0.2)
    """ks."""
    exponent: NonNegative = 32.0
    """e, 0 to 10^6 and beyond: the larger, the smaller the highlight."""

    def diffuse_lobe(self, n_l: Lanes) -> Vectors:
        """(N, 3) kd * n_l."""
        (kd,) = like(n_l, self.diffuse)
        return kd * n_l[:, None]

    def specular_lobe(self, gap_rv: Lanes) -> Vectors:
        """(N, 3) ks * r_v**e, from gap_rv = 1 - r.v."""
        ks, e = like(gap_rv, self.specular, self.exponent)
        return ks * lobe(gap_rv, e)[:, None]
