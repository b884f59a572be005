"""Linear: mu = d / d_max."""

from __future__ import annotations

from typing import Literal

import numpy as np

from illumcli.arrays import Floats
from illumcli.visibility.falloffs._base import Distance, Falloff


class Linear(Falloff):
    falloff: Literal["linear"] = "linear"
    max_distance: Distance
    """d_max, scene units or `0.5r`."""

    def weight(self, distance: Floats, reach: float, radius: float) -> Floats:
        """(N,) min(1, d / d_max)."""
        return np.minimum(distance / reach, 1).astype(distance.dtype)
