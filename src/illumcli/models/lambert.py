"""Lambert: an ideally diffuse surface, with the same radiance in all directions.

response = diffuse / pi * n_l

References
----------
Lambert, J. H. (1760). Photometria.
"""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from illumcli.arrays import Floats, Vectors
from illumcli.models._base import IlluminationModel
from illumcli.models._lobes import tint
from illumcli.models._parameters import Varying
from illumcli.schema.fields import Albedo


class Lambert(IlluminationModel):
    model: Literal["lambert"] = "lambert"
    diffuse: Varying[Albedo] = (0.8, 0.8, 0.8)
    """rho, the albedo."""

    reciprocal: ClassVar[bool] = True
    conserving: ClassVar[bool] = True
    physical: ClassVar[bool] = True

    def diffuse_lobe(self, n_l: Floats) -> Vectors:
        """(N, 3) rho / pi * n_l."""
        return tint(self.diffuse, n_l / np.pi)
