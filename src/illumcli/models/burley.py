"""Burley: a diffuse surface whose edges darken when smooth and brighten towards the light when rough.

response = n_l * rho / pi * (1 + (f - 1) (1 - n_l)^5) * (1 + (f - 1) (1 - n_v)^5)
f = 1/2 + 2 r (l.h)^2

A fit to the measured materials of the MERL database, as a BRDF times the cosine; reciprocal. At grazing a
smooth surface loses up to three quarters, since less light enters it by Fresnel's law. A rough surface gains
up to 6.25 times, and a white one reflects more light than is incident. Only the paper's diffuse part.

References
----------
Burley, B. (2012). Physically-based shading at Disney. SIGGRAPH '12 course notes, section 5.3.
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import fifth, tint
from illumcli.models._parameters import Varying
from illumcli.schema.fields import Albedo, Share


class Burley(IlluminationModel):
    model: Literal["burley"] = "burley"
    diffuse: Varying[Albedo] = (0.8, 0.8, 0.8)
    """rho, the albedo for light and eye along the normal."""
    roughness: Varying[Share] = 0.5
    """r: 0 smooth, edges dark; 1 rough, edges bright towards the light."""

    reciprocal: ClassVar[bool] = True
    physical: ClassVar[bool] = True

    def diffuse_lobe(self, n_l: Floats, n_v: Floats, s_s: Floats) -> Vectors:
        """(N, 3) n_l * rho / pi times both factors, with (l.h)^2 = |l + v|^2 / 4."""
        (r,) = as_dtype_of(n_l, self.roughness)
        edge = 0.5 + r * s_s / 2
        fall = (1 + (edge - 1) * fifth(1 - n_l)) * (1 + (edge - 1) * fifth(1 - n_v))
        return tint(self.diffuse, fall * n_l / np.pi)
