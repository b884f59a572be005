"""Lafortune: a power of a weighted dot product of light and eye, with one weight per axis of the surface.

response = n_l * (rho_d / pi + rho_s * max(0, Cx lx vx + Cy ly vy + Cz lz vz)^e)

x runs along the tangent, y = n x t, z along the normal. A BRDF times the cosine, reciprocal. Cx = Cy = -1 and
Cz = 1 is Phong's lobe about the mirrored light; 1 for all three is retro-reflection; Cz below -Cx tilts the
lobe towards the horizon; different Cx and Cy make it anisotropic. For fits published with weights above 1,
divide them by the largest and multiply rho_s by its e-th power.

References
----------
Lafortune, E. P. F., Foo, S.-C., Torrance, K. E., Greenberg, D. P. (1997). Non-linear approximation of
reflectance functions. SIGGRAPH '97.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from illumcli.arrays import Floats, Vectors, as_dtype_of
from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import lobe, tint
from illumcli.models._parameters import Varying
from illumcli.schema.fields import Albedo, Color, NonNegative

Weight = Varying[Annotated[float, Field(ge=-1, le=1)]]


class Lafortune(IlluminationModel):
    model: Literal["lafortune"] = "lafortune"
    diffuse: Varying[Albedo] = (0.6, 0.6, 0.6)
    """rho_d, the diffuse albedo."""
    specular: Varying[Color] = (0.5, 0.5, 0.5)
    """rho_s, height of the lobe [1/sr]."""
    cx: Weight = -0.95
    """Cx, weight along the grain; -1 mirrors, 1 retro-reflects."""
    cy: Weight = -0.85
    """Cy, weight across the grain; if equal to Cx, the surface is isotropic."""
    cz: Weight = 0.9
    """Cz, weight along the normal; the smaller, the more the highlight grows towards grazing."""
    exponent: Varying[NonNegative] = 20.0
    """e, exponent of the lobe; 0 to 10^6 and beyond."""

    reciprocal: ClassVar[bool] = True
    isotropic: ClassVar[bool] = False
    physical: ClassVar[bool] = True

    def has_grain(self) -> bool:
        """True unless Cx and Cy are equal."""
        return self.cx != self.cy

    def diffuse_lobe(self, n_l: Floats) -> Vectors:
        """(N, 3) n_l * rho_d / pi."""
        return tint(self.diffuse, n_l / np.pi)

    def specular_lobe(
        self, n_l: Floats, n_v: Floats, t_l: Floats, t_v: Floats, b_l: Floats, b_v: Floats
    ) -> Vectors:
        """(N, 3) n_l times the lobe, with 1 - (C l).v = (|C l - v|^2 + |l|^2 - |C l|^2) / 2."""
        cx, cy, cz, e = as_dtype_of(n_l, self.cx, self.cy, self.cz, self.exponent)
        gap = np.zeros_like(n_l)
        for c, l, v in ((cx, t_l, t_v), (cy, b_l, b_v), (cz, n_l, n_v)):
            gap += np.square(c * l - v) + (1 - c) * (1 + c) * np.square(l)
        return tint(self.specular, n_l * lobe(gap / 2, e))
