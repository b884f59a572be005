"""A disc in y = 0, facing +y."""

from __future__ import annotations

from typing import Literal

import numpy as np

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes._base import Rings, Segments, Shape
from illumcli.geometry.shapes._revolution import lathed, profile
from illumcli.schema.fields import Positive


class Disc(Shape):
    shape: Literal["disc"] = "disc"
    radius: Positive = 1.0
    """[scene units]"""
    segments: Segments = 96
    """Facets around."""
    rings: Rings = 1
    """Facets from the middle to the rim."""

    def triangles(self) -> int:
        return 2 * self.segments * self.rings

    def mesh(self) -> Mesh:
        """Triangles around the middle, quads beyond; uv are x and -z in the unit square."""
        radius = self.radius * np.linspace(1, 0, self.rings + 1)
        return lathed([profile(radius, 0.0, (0.0, 1.0), flat=True)], self.segments)
