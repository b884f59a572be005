"""Attenuation of a light with the distance: one class for each ``law:``."""

from __future__ import annotations

from typing import Annotated, Literal, Self, TypeAlias

import numpy as np
from pydantic import Discriminator, model_validator

from illumcli.arrays import Floats
from illumcli.schema.description import Description
from illumcli.schema.fields import NonNegative, Positive


class NoLaw(Description):
    """f(d) = 1: the same at any distance, as the texts' plain Phong model has it."""

    law: Literal["none"] = "none"

    def factor(self, distance: Floats) -> Floats:
        """(N,) 1."""
        return np.ones_like(distance)


class Polynomial(Description):
    """f(d) = 1 / (c1 + c2 d + c3 d^2), the empirical law of the texts, d in scene units."""

    law: Literal["polynomial"] = "polynomial"
    c1: NonNegative = 1.0
    """Constant part of the divisor."""
    c2: NonNegative = 0.0
    """What it grows by per scene unit."""
    c3: NonNegative = 0.0
    """What it grows by per squared scene unit."""

    @model_validator(mode="after")
    def _something_divides(self) -> Self:
        if not (self.c1 or self.c2 or self.c3):
            raise ValueError("c1, c2 and c3 must not all be 0")
        return self

    def factor(self, distance: Floats) -> Floats:
        """(N,) 1 / (c1 + c2 d + c3 d^2)."""
        return 1 / (self.c1 + distance * (self.c2 + distance * self.c3))


class InverseSquare(Description):
    """f(d) = 1 / d^2: radiant intensity [W/sr] becomes irradiance [W/m^2] (Lambert 1760)."""

    law: Literal["inverse_square"] = "inverse_square"

    def factor(self, distance: Floats) -> Floats:
        """(N,) 1 / d^2."""
        return 1 / np.square(distance)


class InverseSquareFlux(Description):
    """f(d) = 1 / (4 pi d^2): the flux [W] of an isotropic source becomes irradiance [W/m^2]."""

    law: Literal["inverse_square_flux"] = "inverse_square_flux"

    def factor(self, distance: Floats) -> Floats:
        """(N,) 1 / (4 pi d^2)."""
        return 1 / (4 * np.pi * np.square(distance))


class Windowed(Description):
    """f(d) = max(0, 1 - (d / range)^4)^2 / d^2: the inverse square brought smoothly to 0 at `range`.

    The window of glTF's KHR_lights_punctual, squared as in Karis (2013), Real shading in Unreal Engine 4.
    """

    law: Literal["windowed"] = "windowed"
    range: Positive
    """Distance from which nothing arrives [scene units]."""

    def factor(self, distance: Floats) -> Floats:
        """(N,) the inverse square times the window; 0 from `range` on."""
        share = np.minimum(distance / self.range, 1)
        return np.square(1 - np.square(np.square(share))) / np.square(distance)


Law: TypeAlias = Annotated[
    NoLaw | Polynomial | InverseSquare | InverseSquareFlux | Windowed, Discriminator("law")
]
