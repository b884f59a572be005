"""Spot light: a point light whose intensity falls from a cone's inside to its rim."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from illumcli.arrays import Vectors, dot, unit
from illumcli.lights._attenuation import Law
from illumcli.lights._base import Light, LightSample, towards
from illumcli.render_space import RenderSpace
from illumcli.schema.description import default_of
from illumcli.schema.fields import Color, Share, Vector


class Spot(Light):
    light: Literal["spot"] = "spot"
    position: Vector
    """Where it is [scene units]."""
    target: Vector = (0.0, 0.0, 0.0)
    """A point on the axis [scene units]."""
    angle: Annotated[float, Field(gt=0, le=180)] = 30.0
    """Half the cone's opening: nothing arrives beyond it [degrees]."""
    softness: Share = 0.2
    """Share of the cone over which the intensity falls smoothly to 0 at the rim."""
    intensity: Color = (1.0, 1.0, 1.0)
    """On the axis [W/sr]."""
    attenuation: Law = default_of({"law": "inverse_square"})
    """Distance law."""

    emission_field: ClassVar[str] = "intensity"

    @model_validator(mode="after")
    def _has_an_axis(self) -> Self:
        if self.position == self.target:
            raise ValueError("position and target must differ")
        return self

    def sample_at(self, position: Vectors, render_space: RenderSpace) -> LightSample:
        """Light at `position`; scale f(d) times the cone's smooth step in the cosine to the axis."""
        light = render_space.from_world(self.position)
        l, distance = towards(light, position)
        # the cone in double precision and by 1 - cos: a narrow one has no digits in a rounded cosine
        gap = gap_to_axis(position - light, np.subtract(self.target, self.position))
        rim, full = np.radians([self.angle, self.angle * (1 - self.softness)]) / 2
        rim_gap, width = 2 * np.sin(rim) ** 2, 2 * np.sin(rim + full) * np.sin(rim - full)
        if width > 0:
            x = np.clip((rim_gap - gap) / width, 0, 1)
            cone = x * x * (3 - 2 * x)
        else:
            cone = gap <= rim_gap
        strength = self.attenuation.factor(distance.astype(np.float64) * render_space.radius) * cone
        return LightSample(l, distance, strength.astype(position.dtype))


def gap_to_axis(direction: NDArray[np.float64], axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) 1 - cos of the angle between (N, 3) vectors and an axis, within 0..2: half the squared distance of
    the unit vectors, which keeps its digits where the cosine is near 1."""
    axis = axis / np.abs(axis).max()
    apart = unit(direction) - axis / np.linalg.norm(axis)
    return np.minimum(dot(apart, apart) / 2, 2)
