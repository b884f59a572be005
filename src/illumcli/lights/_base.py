"""Base of all lights: a colour, a name, and the light that is incident at points if nothing occludes it."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np

from illumcli.arrays import Floats, Vectors, column_major, length
from illumcli.records import Record
from illumcli.render_space import RenderSpace
from illumcli.schema.description import Description
from illumcli.schema.fields import Name

NEAREST = 1e-6
"""Least distance to a light [radii]: 1/d^2 stays finite."""


class LightSample(Record):
    """Light incident at N points if nothing occludes it."""

    l: Vectors  # (N, 3) unit, from the point to the light
    distance: Floats  # (N,) to the light in radii of the scene, inf for a light at infinity
    irradiance_scale: Floats  # (N,) irradiance facing the light, per unit of the light's colour


class Light(Description):
    """A light of the scene."""

    name: Name | None = None
    """Names the light's layers; by default its type and number, as in `point1`."""
    shadows: bool = True
    """False: the light passes through everything and no shadow ray is cast for it."""

    emission_field: ClassVar[str]
    """Name of the field that holds the light's colour and strength."""

    def color(self) -> tuple[float, float, float]:
        """Colour times strength: intensity [W/sr] or irradiance [W/m^2]."""
        return getattr(self, self.emission_field)

    def without_color(self) -> Self:
        """This light without colour, name and shadows: only what `sample_at` depends on."""
        return self.model_copy(update={self.emission_field: (1.0, 1.0, 1.0), "name": None, "shadows": True})

    def sample_at(self, position: Vectors, render_space: RenderSpace) -> LightSample:
        """Light at `position` [(N, 3), radii from the scene's centre]."""
        raise NotImplementedError


def towards(light: np.ndarray, position: Vectors) -> tuple[Vectors, Floats]:
    """Unit vectors from (N, 3) positions to a light at (3,), and its distances, both in radii.

    For lights farther than 10^4 radii the difference and its square are computed in float64, where they lose
    nothing; for nearer lights in the precision of the positions.
    """
    far = np.abs(light).max() > 1e4
    offset = column_major(light.astype(np.float64 if far else position.dtype) - position)
    norm = length(offset)
    if not far and norm.max(initial=0) < 1e-15:
        far, offset = True, column_major(offset, np.float64)
        norm = length(offset)
    distance = np.maximum(norm, NEAREST)
    offset *= (1 / np.maximum(norm, np.finfo(norm.dtype).tiny))[:, None]  # a unit vector; 0 stays 0
    if far:
        return column_major(offset, position.dtype), distance.astype(position.dtype)
    return offset, distance
