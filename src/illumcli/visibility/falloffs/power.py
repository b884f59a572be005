"""Power: mu = (d / d_max)^exponent."""

from __future__ import annotations

from typing import Literal

import numpy as np

from illumcli.arrays import Floats
from illumcli.schema.fields import Positive
from illumcli.visibility.falloffs._base import Distance, Falloff


class Power(Falloff):
    falloff: Literal["power"] = "power"
    max_distance: Distance
    """d_max, scene units or `0.5r`."""
    exponent: Positive = 0.5
    """Below 1, near occluders count most; 1 is the linear falloff."""

    def weight(self, distance: Floats, reach: float, radius: float) -> Floats:
        """(N,) min(1, d / d_max)^exponent."""
        return np.power(np.minimum(distance / reach, 1), self.exponent).astype(distance.dtype)
