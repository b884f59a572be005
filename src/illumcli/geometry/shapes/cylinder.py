"""A cylinder around the y axis."""

from __future__ import annotations

from typing import Literal

import numpy as np

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes._base import Rings, Segments, Shape
from illumcli.geometry.shapes._revolution import lathed, profile
from illumcli.schema.fields import Positive


class Cylinder(Shape):
    shape: Literal["cylinder"] = "cylinder"
    radius: Positive = 1.0
    """[scene units]"""
    height: Positive = 2.0
    """From bottom to top, along y [scene units]."""
    segments: Segments = 96
    """Facets around."""
    rings: Rings = 1
    """Facets from bottom to top."""
    caps: bool = True
    """Closed by discs; without them both rims are open."""

    def triangles(self) -> int:
        return 2 * self.segments * (self.rings + 2)

    def mesh(self) -> Mesh:
        """Quads around, with radial normals; the caps are triangles with their own flat normals."""
        low, high = -self.height / 2, self.height / 2
        side = profile(self.radius, np.linspace(low, high, self.rings + 1), (1.0, 0.0))
        bottom = profile([0.0, self.radius], low, (0.0, -1.0), flat=True)
        top = profile([self.radius, 0.0], high, (0.0, 1.0), flat=True)
        return lathed([bottom, side, top] if self.caps else [side], self.segments)
