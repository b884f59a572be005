"""A ring torus around the y axis."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes._base import Segments, Shape
from illumcli.geometry.shapes._revolution import lathed, profile
from illumcli.schema.fields import Positive


class Torus(Shape):
    shape: Literal["torus"] = "torus"
    major: Positive = 0.75
    """R, from the centre to the middle of the tube."""
    minor: Positive = 0.25
    """r, radius of the tube, below R."""
    segments: Segments = 96
    """Facets around the axis."""
    sides: Annotated[int, Field(ge=3, le=2048)] = 48
    """Facets around the tube."""

    @field_validator("minor")
    @classmethod
    def _has_a_hole(cls, minor: float, info: ValidationInfo) -> float:
        if minor >= info.data.get("major", np.inf):
            raise ValueError(f"must be smaller than major, {info.data['major']}; the torus would cut itself")
        return minor

    def triangles(self) -> int:
        return 2 * self.segments * self.sides

    def mesh(self) -> Mesh:
        """Quads; v runs around the tube from its inner equator."""
        angle = np.pi + 2 * np.pi * np.arange(self.sides + 1) / self.sides
        normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        tube = profile(self.major + self.minor * normal[:, 0], self.minor * normal[:, 1], normal)
        return lathed([tube], self.segments, closed=True)
