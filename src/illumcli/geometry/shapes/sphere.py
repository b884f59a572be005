"""A sphere of meridians and parallels.

Not an icosphere: any number of facets, and a texture map whose seam is one meridian. The facets shrink
towards the poles, the price of both.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes._base import Segments, Shape
from illumcli.geometry.shapes._revolution import lathed, profile
from illumcli.schema.fields import Positive


class Sphere(Shape):
    shape: Literal["sphere"] = "sphere"
    radius: Positive = 1.0
    """[scene units]"""
    segments: Segments = 96
    """Facets around."""
    rings: Annotated[int, Field(ge=2, le=2048)] = 48
    """Facets from pole to pole."""

    def triangles(self) -> int:
        return 2 * self.segments * self.rings

    def mesh(self) -> Mesh:
        """Normals radial; triangles at the poles, quads between; u is the longitude, v the latitude."""
        latitude = np.pi * (np.arange(self.rings + 1) / self.rings - 0.5)
        normal = np.stack([np.cos(latitude), np.sin(latitude)], axis=1)
        normal[[0, -1]] = [0, -1], [0, 1]
        return lathed(
            [profile(self.radius * normal[:, 0], self.radius * normal[:, 1], normal)], self.segments
        )
