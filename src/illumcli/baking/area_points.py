"""Points distributed over the area of all triangles, to which vertex values are fitted."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, column_major, cross, length, take_rows, unit
from illumcli.baking.points import PointsOnTriangles, Surfaces
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry, triangle_corners
from illumcli.rays.interaction import interact, or_geometric
from illumcli.rays.sampling import PLASTIC, hashed, stream, unit_interval


class AreaPoints(PointsOnTriangles):
    """Points distributed evenly over triangles."""

    area: NDArray[np.float64]  # (M,) area of the surface that each point represents, in radii^2

    def barycentric(self) -> tuple[Floats, Floats, Floats]:
        """Three (M,) weights of the corners of each point's triangle."""
        return 1 - self.u - self.v, self.u, self.v


def area_points(surfaces: Surfaces, count: int, seed: int) -> AreaPoints:
    """About `count` points on the triangles, in proportion to their area; at least one on each with an area.

    On each triangle they follow the R2 sequence (Roberts 2018), shifted by a hash of the triangle's index.
    """
    # The number of points on each triangle.
    geometry = surfaces.geometry
    corner = triangle_corners(geometry.vertices, geometry.triangles)
    area = length(cross(corner[1] - corner[0], corner[2] - corner[0])) / 2
    total = area.sum()
    share = np.ceil(area * (count / total)) if total > 0 else np.zeros(len(area))
    size = share.astype(np.int64)
    triangle = np.repeat(np.arange(len(size), dtype=np.int32), size)

    # Their positions: points beyond the diagonal of the unit square are folded back onto the triangle.
    within = np.arange(len(triangle)) - np.repeat(np.cumsum(size) - size, size)
    key = stream(seed, "area")
    shift = [unit_interval(hashed(key + k, np.arange(len(size), dtype=np.uint32)))[triangle] for k in (0, 1)]
    a, b = (within / PLASTIC + shift[0]) % 1, (within / PLASTIC**2 + shift[1]) % 1
    over = a + b > 1
    a, b = np.where(over, 1 - a, a), np.where(over, 1 - b, b)

    # Shading normals, or the triangle's normal if there is none.
    objects = geometry.objects.take(triangle)
    interaction = interact(geometry, objects, triangle, a, b, np.zeros((len(triangle), 3), F))
    n = or_geometric(_interpolated(surfaces.normals, geometry, triangle, a, b), interaction.ng)
    return AreaPoints(
        geometry,
        column_major(n, F),
        column_major(interaction.position, F),
        np.arange(len(triangle), dtype=np.uint32),
        objects,
        np.ones(len(triangle), bool),
        triangle,
        a,
        b,
        (area / np.maximum(size, 1))[triangle],
    )


def _interpolated(
    normals: CornerVectors,
    geometry: SceneGeometry,
    triangle: Ids,
    u: NDArray[np.float64],
    v: NDArray[np.float64],
) -> Vectors:
    """(M, 3) float32 unit interpolated shading normals; 0 where corners have none."""
    if not len(normals.values):
        return np.zeros((len(triangle), 3), F, order="F")
    index = [normals.index.take(geometry.corners[:, k].take(triangle)) for k in range(3)]
    parts = [
        weight.astype(F)[:, None] * np.where(row[:, None] >= 0, take_rows(normals.values, row), F(0))
        for weight, row in zip((1 - u - v, u, v), index, strict=True)
    ]
    return unit(parts[0] + parts[1] + parts[2])
