"""A cone around the y axis, its apex up."""

from __future__ import annotations

from typing import Literal

import numpy as np

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes._base import Rings, Segments, Shape
from illumcli.geometry.shapes._revolution import lathed, profile
from illumcli.schema.fields import Positive


class Cone(Shape):
    shape: Literal["cone"] = "cone"
    radius: Positive = 1.0
    """Of the base [scene units]."""
    height: Positive = 2.0
    """From the base to the apex, along y [scene units]."""
    segments: Segments = 96
    """Facets around."""
    rings: Rings = 1
    """Facets from the base to the apex."""
    caps: bool = True
    """Closed by a disc; without it the rim is open."""

    def triangles(self) -> int:
        return 2 * self.segments * (self.rings + 1)

    def mesh(self) -> Mesh:
        """Quads, and triangles at the apex, where a cone has no normal: each has that of its middle there."""
        rise = np.linspace(0, 1, self.rings + 1)
        slope = np.hypot(self.radius, self.height)
        normal = (self.height / slope, self.radius / slope)
        side = profile(self.radius * (1 - rise), self.height * (rise - 0.5), normal)
        base = profile([0.0, self.radius], -self.height / 2, (0.0, -1.0), flat=True)
        return lathed([base, side] if self.caps else [side], self.segments)
