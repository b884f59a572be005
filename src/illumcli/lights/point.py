"""Point light: the same intensity in every direction from one position."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from illumcli.arrays import Vectors
from illumcli.lights._attenuation import Law
from illumcli.lights._base import Light, LightSample, towards
from illumcli.render_space import RenderSpace
from illumcli.schema.description import default_of
from illumcli.schema.fields import Color, Vector


class Point(Light):
    light: Literal["point"] = "point"
    position: Vector
    """Where it is [scene units]."""
    intensity: Color = (1.0, 1.0, 1.0)
    """[W/sr] under the inverse square; a plain factor under the other laws."""
    attenuation: Law = default_of({"law": "inverse_square"})
    """Distance law."""

    emission_field: ClassVar[str] = "intensity"

    def sample_at(self, position: Vectors, render_space: RenderSpace) -> LightSample:
        """Light at `position`; scale f(d)."""
        l, distance = towards(render_space.from_world(self.position), position)
        scene_units = distance.astype(np.float64) * render_space.radius
        return LightSample(l, distance, self.attenuation.factor(scene_units).astype(position.dtype))
