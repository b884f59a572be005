"""Smooth: mu = x^2 (3 - 2 x) with x = d / d_max; its slope is 0 at contact and at d_max."""

from __future__ import annotations

from typing import Literal

import numpy as np

from illumcli.arrays import Floats
from illumcli.visibility.falloffs._base import Distance, Falloff


class Smooth(Falloff):
    falloff: Literal["smooth"] = "smooth"
    max_distance: Distance
    """d_max, scene units or `0.5r`."""

    def weight(self, distance: Floats, reach: float, radius: float) -> Floats:
        """(N,) the cubic smoothstep."""
        x = np.minimum(distance / reach, 1)
        return (x * x * (3 - 2 * x)).astype(distance.dtype)
