"""Lommel-Seeliger: single scattering in a deep layer of dark dust.

response = n_l * w / (4 pi (n_l + n_v))

A BRDF times the cosine, reciprocal, for particles that scatter equally in all directions. Multiple scattering
is neglected, so at most half of the light is reflected. If the light is behind the eye, the disc of a sphere
is uniformly bright, like the full Moon's. The albedo for ambient light is w * 2/3 (1 - ln 2), that under a
uniform sky.

References
----------
Seeliger, H. (1887). Zur Theorie der Beleuchtung der grossen Planeten. Abh. Bayer. Akad. Wiss. 16.
Hapke, B. (1981). Bidirectional reflectance spectroscopy 1. Theory. J. Geophys. Res. 86.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np

from illumcli.arrays import Floats, Vectors
from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import tint, weighted
from illumcli.models._parameters import Varying
from illumcli.schema.fields import Albedo


class LommelSeeliger(IlluminationModel):
    model: Literal["lommel_seeliger"] = "lommel_seeliger"
    diffuse: Varying[Albedo] = (0.8, 0.8, 0.8)
    """w, share of light that a particle scatters rather than absorbs."""

    reciprocal: ClassVar[bool] = True
    conserving: ClassVar[bool] = True
    physical: ClassVar[bool] = True

    def diffuse_color(self) -> Any:
        """The albedo under a uniform sky."""
        return weighted(self.diffuse, 2 / 3 * (1 - np.log(2)))

    def diffuse_lobe(self, n_l: Floats, n_v: Floats) -> Vectors:
        """(N, 3) w n_l / (4 pi (n_l + n_v))."""
        return tint(self.diffuse, n_l / (n_l + n_v) / (4 * np.pi))
