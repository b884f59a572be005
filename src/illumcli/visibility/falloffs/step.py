"""Step: every occluder within reach counts fully; this is ambient occlusion."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from illumcli.arrays import Floats
from illumcli.visibility.falloffs._base import Falloff


class Step(Falloff):
    falloff: Literal["step"] = "step"

    step: ClassVar[bool] = True

    def weight(self, distance: Floats, reach: float, radius: float) -> Floats:
        """(N,) 1 at and beyond reach, 0 before."""
        return (distance >= min(reach, float(np.finfo(distance.dtype).max))).astype(distance.dtype)
