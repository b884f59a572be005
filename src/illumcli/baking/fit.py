"""Vertex values that fit obscurance all over the surface: right where they are interpolated.

The value at a vertex alone tells nothing of the middle of its triangles. Here points are spread over the
area, each casts a few rays, and vertex values are chosen so that what renderers interpolate from them comes
nearest to what the points saw, in the mean square over the area.

References
----------
Kavan, L., Bargteil, A. W. and Sloan, P.-P. (2011). Least squares vertex baking. EGSR, CGF 30(4).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.baking.points import AreaPoints, Surfaces, Vertices, area_points, vertex_points
from illumcli.baking.sampling import BakeSampler, Occluders
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.records import Record
from illumcli.visibility.obscurance import Method

RAYS_PER_POINT = 16
PARTS = 8
"""The points are dealt to so many parts, and what the fit leaves over in each says how far it errs."""
SMOOTHING = 0.02
"""Weight of the squared difference along edges, as a share of the area around: it only decides where points
are few."""
STEPS, ENOUGH = 500, 1e-6


class Fit(Record):
    """Values of the points at vertices by least squares, and what it took."""

    w: NDArray[np.float32]  # (M,)
    error: NDArray[np.float32]  # (M,)
    points: int
    open: int
    vertices: Vertices


def fitted(
    surfaces: Surfaces,
    occluders: Sequence[Occluders],
    method: Method,
    seed: int,
    threads: int,
    progress: Callable[[str, int, int], None],
    rays: dict[str, int],
) -> Fit:
    """As many rays as `method.samples` per vertex, spread over the area.

    The error of a value is how far what is left over in eight parts of the points would move it: it holds
    the error of the rays and that of where the points lie.
    """
    vertices = vertex_points(surfaces)
    per_point = min(RAYS_PER_POINT, method.samples)
    count = len(vertices.points.number) * method.samples // per_point
    area = area_points(surfaces, max(count, PARTS), seed)
    own = Method(per_point, method.falloff, method.radius, method.sampler, method.faces)
    caster = BakeSampler(area, occluders, own, seed, threads, progress)
    is_open = caster.open()
    lanes = np.flatnonzero(~is_open)
    found = caster.cast("values", lanes, np.full(len(lanes), per_point), 0)
    w = np.ones(len(is_open))
    w[lanes] = found.w
    rays.update(caster.rays)
    system = System.of(surfaces.world, area, vertices)
    mean = system.solve(system.side(area, w)[:, None])[:, 0]
    rest = w - system.at(area, mean)
    part = np.arange(len(w)) % PARTS
    sides = np.stack([system.side(area, np.where(part == k, rest, 0.0)) for k in range(PARTS)], axis=1)
    spread = np.sqrt(np.square(system.solve(sides)).sum(axis=1) * PARTS / (PARTS - 1))
    value, error = np.clip(mean, 0, 1).astype(F), spread.astype(F)
    if is_open.all():
        value, error = np.ones_like(value), np.zeros_like(error)
    return Fit(value, error, len(lanes), int(is_open.sum()), vertices)


class System(Record):
    """The normal equations of the fit: symmetric, a 3 by 3 block per triangle, never stored as a matrix."""

    corner: NDArray[np.int64]  # (T, 3) unknown at each corner
    block: NDArray[np.float64]  # (T, 3, 3)
    count: int

    @classmethod
    def of(cls, world: SceneGeometry, area: AreaPoints, vertices: Vertices) -> System:
        """The blocks: area times products of barycentric weights, and a little smoothing along edges."""
        corner = np.maximum(vertices.row[world.corners], 0)
        weights = barycentric(area)
        block = np.empty((len(corner), 3, 3))
        for i in range(3):
            for j in range(3):
                values = area.area * weights[i] * weights[j]
                block[:, i, j] = np.bincount(area.triangle, values, len(corner))
        total = np.bincount(area.triangle, area.area, len(corner))
        smooth = np.full((3, 3), -1.0) + 3 * np.eye(3)
        block += SMOOTHING / 3 * total[:, None, None] * smooth
        return cls(corner, block, len(vertices.points.number))

    def side(self, area: AreaPoints, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(M,) right side for values at the points."""
        out = np.zeros(self.count)
        for k, weight in enumerate(barycentric(area)):
            out += np.bincount(self.corner[area.triangle, k], area.area * weight * values, self.count)
        return out

    def at(self, area: AreaPoints, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """(M,) what vertex values give at the points."""
        corner = self.corner[area.triangle]
        a, b, c = (weight * x[corner[:, k]] for k, weight in enumerate(barycentric(area)))
        return a + b + c

    def times(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """(M, k) the matrix times k vectors."""
        made = np.einsum("tij,tjk->tik", self.block, x[self.corner])
        out = np.empty_like(x)
        index = self.corner.ravel()
        for k in range(x.shape[1]):
            out[:, k] = np.bincount(index, made[:, :, k].ravel(), self.count)
        return out

    def solve(self, sides: NDArray[np.float64]) -> NDArray[np.float64]:
        """(M, k) by conjugate gradients, each column its own, preconditioned by the diagonal."""
        diagonal = np.bincount(self.corner.ravel(), np.einsum("tii->ti", self.block).ravel(), self.count)[
            :, None
        ]
        scale = np.divide(1, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0)
        x = scale * sides
        rest = sides - self.times(x)
        way = scale * rest
        square = (rest * way).sum(axis=0)
        enough = ENOUGH**2 * (sides * scale * sides).sum(axis=0)
        for _ in range(STEPS):
            if (square <= enough).all():
                break
            image = self.times(way)
            bend = (way * image).sum(axis=0)
            step = np.divide(square, bend, out=np.zeros_like(square), where=bend > 0)
            x += step * way
            rest -= step * image
            scaled = scale * rest
            before, square = square, (rest * scaled).sum(axis=0)
            way = scaled + np.divide(square, before, out=np.zeros_like(square), where=before > 0) * way
        return x


def barycentric(area: AreaPoints) -> tuple[NDArray[np.float64], ...]:
    """Three (M,) weights of the points on their triangles."""
    return 1 - area.u - area.v, area.u, area.v
