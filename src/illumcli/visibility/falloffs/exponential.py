"""Exponential: mu = (1 - exp(-tau d)) / (1 - exp(-tau d_max)).

References
----------
Zhukov, S., Iones, A. and Kronin, G. (1998). An ambient light illumination model. EGWR '98. Dividing by the
value at d_max makes mu continuous there; without d_max, mu = 1 - exp(-tau d).
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from illumcli.arrays import Floats
from illumcli.schema.fields import Positive
from illumcli.visibility.falloffs._base import Falloff


class Exponential(Falloff):
    falloff: Literal["exponential"] = "exponential"
    tau: Positive = 1.0
    """Decay per scene unit, or per radius of the scene when `relative`."""
    relative: bool = False
    """True: tau is counted per radius of the scene, so that scaling a scene changes nothing."""

    def weight(self, distance: Floats, reach: float, radius: float) -> Floats:
        """(N,) by expm1, so that tau d of 1e-12 keeps its digits."""
        tau = self.tau / radius if self.relative else self.tau
        full = -np.expm1(-tau * reach)
        return np.where(distance >= reach, 1, np.expm1(-tau * distance) / -full).astype(distance.dtype)
