"""A rectangle in y = 0, facing +y."""

from __future__ import annotations

from typing import Literal

import numpy as np

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes._base import CellsByCells, Shape
from illumcli.geometry.shapes._lattice import Lattice, vertex_numbers, woven
from illumcli.schema.fields import Pair, Positive


class Plane(Shape):
    shape: Literal["plane"] = "plane"
    size: Pair[Positive] = (2.0, 2.0)
    """Extent along x and z."""
    resolution: CellsByCells = (1, 1)
    """Quads along x and z."""

    def triangles(self) -> int:
        return 2 * self.resolution[0] * self.resolution[1]

    def mesh(self) -> Mesh:
        """Quads; u runs along x, v along -z."""
        columns, rows = self.resolution
        u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
        points = np.stack([(u - 0.5) * self.size[0], np.zeros_like(u), (0.5 - v) * self.size[1]], axis=-1)
        normals = np.broadcast_to([0.0, 1.0, 0.0], points.shape)
        vertex = vertex_numbers(np.arange(rows + 1), np.arange(columns + 1))
        return woven(Lattice(points, normals, np.stack([u, v], axis=-1), vertex))
