"""A box; its faces are flat, their corners are shared."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes._base import Shape
from illumcli.schema.fields import Positive, Triple

FACES = (  # direction to the right and upwards, seen from outside
    ((0, 0, -1), (0, 1, 0)),  # +x
    ((0, 0, 1), (0, 1, 0)),  # -x
    ((1, 0, 0), (0, 0, -1)),  # +y
    ((1, 0, 0), (0, 0, 1)),  # -y
    ((1, 0, 0), (0, 1, 0)),  # +z
    ((-1, 0, 0), (0, 1, 0)),  # -z
)


class Box(Shape):
    shape: Literal["box"] = "box"
    size: Triple[Positive] = (2.0, 2.0, 2.0)
    """Extent along x, y and z."""
    resolution: Annotated[int, Field(ge=1, le=1024)] = 1
    """Quads along each edge."""

    def triangles(self) -> int:
        return 12 * self.resolution**2

    def mesh(self) -> Mesh:
        """Quads, each face with uv from 0 to 1."""
        # Nodes of the six faces as whole steps from the lowest corner; equal ones are one vertex.
        n = self.resolution
        j, i = np.indices((n + 1, n + 1))[..., None]
        right, up = np.array(FACES)[:, :, None, None].swapaxes(0, 1)
        out = np.cross(right, up)
        steps = (n * (1 + out) + (2 * i - n) * right + (2 * j - n) * up) // 2  # (6, n + 1, n + 1, 3), 0 to n
        numbers = (steps[..., 0] * (n + 1) + steps[..., 1]) * (n + 1) + steps[..., 2]
        _, first, vertex = np.unique(numbers, return_index=True, return_inverse=True)

        # Quads between the nodes of each face.
        nodes = np.arange(numbers.size).reshape(numbers.shape)
        quads = np.stack(
            [nodes[:, :-1, :-1], nodes[:, :-1, 1:], nodes[:, 1:, 1:], nodes[:, 1:, :-1]], axis=-1
        ).ravel()
        uv = np.broadcast_to(np.concatenate([i, j], axis=-1) / n, (6, n + 1, n + 1, 2))
        return Mesh(
            vertices=(steps.reshape(-1, 3)[first] / n - 0.5) * self.size,
            corners=vertex.ravel()[quads].astype(np.int32),
            starts=np.arange(0, len(quads) + 1, 4, dtype=np.int32),
            normals=out.reshape(6, 3).astype(np.float64),
            corner_normals=np.repeat(np.arange(6, dtype=np.int32), 4 * n * n),
            uvs=uv.reshape(-1, 2).copy(),
            corner_uvs=quads.astype(np.int32),
        )
