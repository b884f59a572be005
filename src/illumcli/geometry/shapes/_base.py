"""What every built-in shape is: a description that makes a Mesh with exact normals."""

from __future__ import annotations

from illumcli.description import Description
from illumcli.geometry.mesh import Mesh


class Shape(Description):
    """A surface given by a formula; y points up, sizes are in scene units."""

    def mesh(self) -> Mesh:
        """The shape as polygons with exact normals."""
        raise NotImplementedError
