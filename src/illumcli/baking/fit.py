"""The method `fit`: vertex values that fit obscurance all over the surface, so that it is right where it is
interpolated.

The value at a vertex says nothing about the middle of its triangles. Here points are spread over the area,
each casts a few rays, and vertex values are chosen so that what renderers interpolate from them has the least
mean square difference from the points over the area.

References
----------
Kavan, L., Bargteil, A. W. and Sloan, P.-P. (2011). Least squares vertex baking. EGSR, CGF 30(4).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.baking.area_points import AreaPoints, area_points
from illumcli.baking.context import BakeContext, PointChannels, SampleStatistics, VertexChannels
from illumcli.baking.sampling import BakeSampler, RayCounts
from illumcli.baking.vertex_points import Vertices, vertex_points
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.records import Record

RAYS_PER_POINT = 16
PARTS = 8
"""Number of parts that the points are divided into; the residuals in each of them estimate the error."""
SMOOTHING = 0.02
"""Weight of the squared differences along edges, as a share of the area around; it matters only where
points are few."""
MAX_STEPS, TOLERANCE = 500, 1e-6


def fitted_to_surface(context: BakeContext) -> VertexChannels:
    """Vertex values by least squares, with `samples` rays per vertex spread over the area.

    The standard error of a value is estimated by how much the residuals in each of eight parts of the points
    would change it. It includes the errors of rays and of the points' positions.
    """
    # Estimate obscurance at points on the surface.
    settings = context.settings
    vertices = vertex_points(context.surfaces, context.threads)
    per_point = min(RAYS_PER_POINT, settings.samples)
    count = len(vertices.points.key) * settings.samples // per_point
    area = area_points(context.surfaces, max(count, PARTS), settings.seed)
    (measure,) = context.measures
    measure = replace(measure, method=replace(measure.method, samples=per_point))
    sampler = BakeSampler(area, context.occluders, measure, settings.seed, context.threads, context.progress)
    is_open = sampler.open_points()
    closed = np.flatnonzero(~is_open)
    estimates = sampler.estimate("values", RayCounts(closed, np.full(len(closed), per_point)), 0)
    w = np.ones(len(is_open))
    w[closed] = estimates.values.w

    # Fit the vertex values.
    equations = NormalEquations.of(context.surfaces.geometry, area, vertices)
    mean = equations.solve(equations.right_side(area, w)[:, None])[:, 0]

    # Estimate their errors from the residuals.
    residual = w - equations.interpolated(area, mean)
    part = np.arange(len(w)) % PARTS
    sides = [equations.right_side(area, np.where(part == k, residual, 0.0)) for k in range(PARTS)]
    changes = equations.solve(np.stack(sides, axis=1))
    spread = np.sqrt(np.square(changes).sum(axis=1) * PARTS / (PARTS - 1))
    value, error = np.clip(mean, 0, 1).astype(F), spread.astype(F)
    if is_open.all():
        value, error = np.ones_like(value), np.zeros_like(error)
    context.clock.lap("cast")
    statistics = SampleStatistics(
        open=int(is_open.sum()),
        cast=len(closed),
        rmse=float(np.sqrt(np.mean(np.square(error, dtype=np.float64)))) if len(error) else 0.0,
        target=None,
        scale=1.0,
        rays={"values": estimates.rays} if estimates.rays else {},
        resumed=0,
        samples={settings.samples: len(closed)},
        reconstruction=None,
    )
    channels = {measure.channel: value, measure.error: error}
    return VertexChannels(vertices, PointChannels(channels, {measure.channel: statistics}))


class NormalEquations(Record):
    """The normal equations of the fit: symmetric, a 3 by 3 block per triangle, never assembled."""

    corner: NDArray[np.int64]  # (T, 3) unknown at each corner
    block: NDArray[np.float64]  # (T, 3, 3)
    count: int  # of unknowns

    @classmethod
    def of(cls, geometry: SceneGeometry, area: AreaPoints, vertices: Vertices) -> NormalEquations:
        """The blocks: area times products of barycentric weights, and a little smoothing along edges."""
        corner = np.maximum(vertices.point_of_corner[geometry.corners], 0)
        weights = area.barycentric()
        block = np.empty((len(corner), 3, 3))
        for i in range(3):
            for j in range(3):
                values = area.area * weights[i] * weights[j]
                block[:, i, j] = np.bincount(area.triangle, values, len(corner))
        total = np.bincount(area.triangle, area.area, len(corner))
        smooth = np.full((3, 3), -1.0) + 3 * np.eye(3)
        block += SMOOTHING / 3 * total[:, None, None] * smooth
        return cls(corner, block, len(vertices.points.key))

    def right_side(self, area: AreaPoints, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(M,) right side for values at the points."""
        out = np.zeros(self.count)
        for k, weight in enumerate(area.barycentric()):
            out += np.bincount(self.corner[area.triangle, k], area.area * weight * values, self.count)
        return out

    def interpolated(self, area: AreaPoints, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vertex values (M,) interpolated at the points."""
        corner = self.corner[area.triangle]
        a, b, c = (weight * x[corner[:, k]] for k, weight in enumerate(area.barycentric()))
        return a + b + c

    def times(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """(M, k) the matrix times k vectors."""
        products = np.einsum("tij,tjk->tik", self.block, x[self.corner])
        out = np.empty_like(x)
        index = self.corner.ravel()
        for k in range(x.shape[1]):
            out[:, k] = np.bincount(index, products[:, :, k].ravel(), self.count)
        return out

    def solve(self, sides: NDArray[np.float64]) -> NDArray[np.float64]:
        """(M, k) by conjugate gradients for each column, preconditioned by the diagonal."""
        # Start from the solution of the diagonal.
        diagonal = np.bincount(self.corner.ravel(), np.einsum("tii->ti", self.block).ravel(), self.count)
        diagonal = diagonal[:, None]
        inverse = np.divide(1, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0)
        x = inverse * sides
        residual = sides - self.times(x)
        direction = inverse * residual
        square = (residual * direction).sum(axis=0)
        enough = TOLERANCE**2 * (sides * inverse * sides).sum(axis=0)
        for _ in range(MAX_STEPS):
            if (square <= enough).all():
                break
            # Step to the minimum along the direction.
            image = self.times(direction)
            curvature = (direction * image).sum(axis=0)
            step = np.divide(square, curvature, out=np.zeros_like(square), where=curvature > 0)
            x += step * direction
            residual -= step * image
            # The next direction is conjugate to the last.
            scaled = inverse * residual
            before, square = square, (residual * scaled).sum(axis=0)
            direction = (
                scaled + np.divide(square, before, out=np.zeros_like(square), where=before > 0) * direction
            )
        return x
