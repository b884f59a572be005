"""Directional light: parallel light from infinitely far away."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from illumcli.arrays import Vectors
from illumcli.lights._base import Light, LightSample
from illumcli.render_space import RenderSpace
from illumcli.schema.fields import Color, Direction


class Directional(Light):
    light: Literal["directional"] = "directional"
    direction: Direction
    """Where the light goes; any length."""
    irradiance: Color = (1.0, 1.0, 1.0)
    """[W/m^2] on a surface that faces the light."""

    emission_field: ClassVar[str] = "irradiance"

    def sample_at(self, position: Vectors, render_space: RenderSpace) -> LightSample:
        """Light at `position`: the same everywhere, scale 1, distance inf."""
        count = len(position)
        direction = -np.asarray(self.direction) / np.abs(self.direction).max()
        l = (direction / np.linalg.norm(direction)).astype(position.dtype)
        return LightSample(
            np.broadcast_to(l, (count, 3)),
            np.broadcast_to(position.dtype.type(np.inf), count),
            np.broadcast_to(position.dtype.type(1), count),
        )
