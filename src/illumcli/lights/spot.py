"""Spot light: a point light whose intensity falls from a cone's inside to its rim."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

import numpy as np

from illumcli.arrays import Vectors
from illumcli.description import written
from illumcli.frame import Frame
from illumcli.lights._attenuation import Law
from illumcli.lights._base import Arriving, Light, towards
from illumcli.values import Color, Share, Vector, Within


class Spot(Light):
    light: Literal["spot"]
    position: Vector
    """[scene units]"""
    target: Vector = (0.0, 0.0, 0.0)
    """A point on the axis [scene units]."""
    angle: Annotated[float, Within(gt=0, le=180)] = 30.0
    """Half the cone's opening: nothing arrives beyond it [degrees]."""
    softness: Share = 0.2
    """Share of the cone over which the intensity falls smoothly to 0 at the rim."""
    intensity: Color = (1.0, 1.0, 1.0)
    """On the axis [W/sr]."""
    attenuation: Law = written({"law": "inverse_square"})
    """Distance law."""

    power: ClassVar[str] = "intensity"

    def check(self) -> None:
        """The axis must have a direction."""
        if self.position == self.target:
            raise ValueError("position and target must differ")

    def arriving(self, position: Vectors, frame: Frame) -> Arriving:
        """Light at `position`; strength f(d) times the cone's smooth step."""
        l, distance = towards(frame.inward(self.position), position)
        axis = np.asarray(self.target) - self.position
        axis = axis / np.abs(axis).max()
        axis = (axis / np.linalg.norm(axis)).astype(position.dtype)
        cosine = -(l[:, 0] * axis[0] + l[:, 1] * axis[1] + l[:, 2] * axis[2])
        rim, full = np.cos(np.radians([self.angle, self.angle * (1 - self.softness)]))
        if full > rim:
            x = np.clip((cosine - rim) / (full - rim), 0, 1)
            cone = x * x * (3 - 2 * x)
        else:
            cone = cosine >= rim
        strength = self.attenuation.factor(distance.astype(np.float64) * frame.radius) * cone
        return Arriving(l, distance, strength.astype(position.dtype))
