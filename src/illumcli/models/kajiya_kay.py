"""Kajiya-Kay: hair and grooves as thin cylinders along the tangent.

response = kd * |t x l| + ks * max(0, |t x l| |t x v| - (t.l) (t.v))^e

The irradiance of a strand is proportional to the sine of the light's angle to the tangent t. The highlight
lies on the cone that mirrors the light about the strand: t.v = -t.l, with l and v both leaving the strand.
Some texts print cos(theta_l - theta_v) with v towards the strand. An intensity model: cosine (here: sine)
included, no 1/pi.

If the strand lies on a surface, the surface still blocks light from below its horizon.

References
----------
Kajiya, J. T., Kay, T. L. (1989). Rendering fur with three dimensional textures. SIGGRAPH '89.
Banks, D. C. (1994). Illumination in diverse codimensions. SIGGRAPH '94.
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import lobe, tint
from illumcli.models._parameters import Varying
from illumcli.schema.fields import Color, NonNegative


class KajiyaKay(IlluminationModel):
    model: Literal["kajiya_kay"] = "kajiya_kay"
    diffuse: Varying[Color] = (0.6, 0.6, 0.6)
    """kd, the diffuse share."""
    specular: Varying[Color] = (0.3, 0.3, 0.3)
    """ks, the share of the highlight."""
    exponent: Varying[NonNegative] = 32.0
    """e, 0 to 10^6 and beyond: the larger, the narrower the highlight across the strand."""

    isotropic: ClassVar[bool] = False

    def diffuse_lobe(self, sin_tl: Floats) -> Vectors:
        """(N, 3) kd * |t x l|."""
        return tint(self.diffuse, sin_tl)

    def specular_lobe(self, sin_tl: Floats, sin_tv: Floats, t_l: Floats, t_v: Floats) -> Vectors:
        """(N, 3) ks * cos(angle to the cone)^e, with 1 - cos as half a squared distance."""
        (e,) = as_dtype_of(t_l, self.exponent)
        gap = (np.square(sin_tl - sin_tv) + np.square(t_l + t_v)) / 2
        return tint(self.specular, lobe(gap, e))
