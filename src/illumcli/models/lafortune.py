"""Lafortune: powers of weighted dot products of light and eye, with one weight per axis of the surface.

response = n_l * (rho_d / pi + sum of rho_s * max(0, Cx lx vx + Cy ly vy + Cz lz vz)^e over the lobes)

x runs along the tangent, y = n x t, z along the normal. A BRDF times the cosine, reciprocal. Cx = Cy = -1 and
Cz = 1 is Phong's lobe about the mirrored light; 1 for all three is retro-reflection; Cz below -Cx tilts the
lobe towards the horizon; different Cx and Cy make it anisotropic. For fits published with weights above 1,
divide them by the largest and multiply rho_s by its e-th power. The first lobe is that of the model's own
keys; measured materials are mostly fitted with two or three: further: [{cx: 0.9, cy: 0.9, exponent: 8}].

References
----------
Lafortune, E. P. F., Foo, S.-C., Torrance, K. E., Greenberg, D. P. (1997). Non-linear approximation of
reflectance functions. SIGGRAPH '97.
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from illumcli.arrays import Floats, Vectors
from illumcli.models._base import IlluminationModel, Lobe, is_always
from illumcli.models._lafortune import FurtherLobe, Weight, weighted_lobe
from illumcli.models._lobes import tint
from illumcli.models._parameters import Varying
from illumcli.schema.fields import Albedo, Color, ListOf, NonNegative


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
    further: ListOf[FurtherLobe] = ()
    """Lobes that are added to the first: a list of mappings with the keys `specular`, `cx`, `cy`, `cz` and
    `exponent`."""

    scales: ClassVar[dict[str, tuple[str, ...]]] = {"diffuse_lobe": ("diffuse",)}
    reciprocal: ClassVar[bool] = True
    isotropic: ClassVar[bool] = False
    physical: ClassVar[bool] = True

    def has_grain(self) -> bool:
        """True unless Cx and Cy of every lobe are equal."""
        return any(each.cx != each.cy for each in self.every_lobe())

    def lobes(self) -> dict[str, Lobe]:
        """The diffuse lobe, and the specular ones as one."""
        lobes = super().lobes()
        if all(is_always(each.specular, 0) for each in self.every_lobe()):
            del lobes["specular"]
        return lobes

    def diffuse_lobe(self, n_l: Floats) -> Vectors:
        """(N, 3) n_l * rho_d / pi."""
        return tint(self.diffuse, n_l / np.pi)

    def specular_lobe(
        self, n_l: Floats, n_v: Floats, t_l: Floats, t_v: Floats, b_l: Floats, b_v: Floats
    ) -> Vectors:
        """(N, 3) n_l times the sum of the lobes."""
        l, v = (t_l, b_l, n_l), (t_v, b_v, n_v)
        first, *further = (
            tint(each.specular, n_l * weighted_lobe(l, v, (each.cx, each.cy, each.cz), each.exponent))
            for each in self.every_lobe()
        )
        return sum(further, start=first)

    def every_lobe(self) -> tuple[FurtherLobe, ...]:
        """The lobe of the model's own keys, and the further ones."""
        own = {name: getattr(self, name) for name in FurtherLobe.model_fields}
        return (FurtherLobe.model_construct(**own), *self.further)
