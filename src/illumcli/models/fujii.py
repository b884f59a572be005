"""Fujii: Oren-Nayar's qualitative form without its dark ring, from three dot products.

response = n_l * rho * (A + B s / t)
s = l.v - n_l n_v;  t = max(n_l, n_v) where s > 0, otherwise 1
A = 1 / (pi + (pi/2 - 2/3) sigma'),  B = sigma' A                    by default
A = (1 - 0.5 s2 / (s2 + 0.33) + 0.17 rho s2 / (s2 + 0.13)) / pi      with `sigma`; s2 = sigma^2
B = 0.45 s2 / (s2 + 0.09) / pi

A BRDF times the cosine, reciprocal. Where light and eye are on opposite sides, s < 0, it falls on, while
Oren-Nayar's qualitative form stops at A with a kink. By default A is such that a white surface reflects all
light that comes in at grazing, and less at any other angle. With `sigma`, A and B are those of Oren-Nayar's
full form, which it then follows: a white surface reflects up to 2.9 % more light than is incident. In percent
of the mean of the full form, at rho = 0.8 (RMS over light and eye, weighted by both cosines, and the largest
difference up to 80 degrees, which is where both are at 80 degrees, a quarter turn apart):

    sigma                        0.1   0.3   0.5   1.0   1.57
    RMS                          0.3   1.6   2.5   3.6    4.1
    largest                        4    23    36    53     60
    RMS of the qualitative form  1.1   6.0   9.7  14.5   16.6

References
----------
Fujii, Y. (2013). A tiny improvement of Oren-Nayar reflectance model.
https://mimosa-pudica.net/improved-oren-nayar.html
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import channels, flattening, tint
from illumcli.models._parameters import Spread, Varying
from illumcli.schema.fields import Albedo, Share


class Fujii(IlluminationModel):
    model: Literal["fujii"] = "fujii"
    diffuse: Varying[Albedo] = (0.8, 0.8, 0.8)
    """rho, the albedo of the facets."""
    roughness: Varying[Share] = 0.5
    """sigma', the weight of s / t: 0 is Lambert, 1 the flattest."""
    sigma: Varying[Spread] | None = None
    """sigma, standard deviation of the facets' slope angle [rad]. If given, it replaces the roughness, and A
    and B are Oren-Nayar's."""

    reciprocal: ClassVar[bool] = True
    conserving: ClassVar[bool] = True
    physical: ClassVar[bool] = True

    def claimed(self) -> frozenset[str]:
        """The claims of the class; with `sigma`, white surfaces do not conserve energy."""
        return super().claimed() - (set() if self.sigma is None else {"conserving"})

    def diffuse_lobe(self, n_l: Floats, n_v: Floats, l_v: Floats) -> Vectors:
        """(N, 3) n_l * rho * (A + B s / t)."""
        ratio = flattening(n_l, n_v, l_v)
        if self.sigma is None:
            (sigma,) = as_dtype_of(n_l, self.roughness)
            return tint(self.diffuse, n_l * (1 + sigma * ratio) / (np.pi + (np.pi / 2 - 2 / 3) * sigma))
        (sigma,) = as_dtype_of(n_l, self.sigma)
        s2 = np.square(sigma)
        rho = channels(n_l, self.diffuse)
        A = 1 - s2 / (s2 + 0.33) / 2 + rho * (0.17 * s2 / (s2 + 0.13))
        return (rho * (A + 0.45 * s2 / (s2 + 0.09) * ratio) * (n_l / np.pi)).T
