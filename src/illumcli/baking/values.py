"""From the points of a bake to the corners and vertices that take their values."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, unit
from illumcli.baking.context import VertexChannels
from illumcli.baking.vertex_points import Vertices
from illumcli.records import Record
from illumcli.visibility.baked import Baked
from illumcli.visibility.channels import CHANNELS, Channel


def baked_values(values: VertexChannels) -> Baked:
    """Channels at vertices, and at corners where some vertex has several points.

    A vertex has the mean over its corners, weighted by angle. Vertices without a point have the channel's
    value for that: they are open, with error 0.
    """
    vertices, of_points = values.vertices, values.of_points.channels
    shares = PointShares.of(vertices)
    at_vertices = {name: shares.mean(CHANNELS[name], array) for name, array in of_points.items()}
    if len(shares.point) == np.count_nonzero(shares.total):
        return Baked(at_vertices)

    # some vertex has several points: corners have values of their own
    at_corners = {name: _of_corners(vertices, CHANNELS[name], array) for name, array in of_points.items()}
    return Baked(at_vertices, corner_channels=at_corners)


def _of_corners(vertices: Vertices, channel: Channel, of_points: NDArray[np.float32]) -> NDArray[np.float32]:
    has_point = np.flatnonzero(vertices.point_of_corner >= 0)
    out = np.full((len(vertices.point_of_corner), *of_points.shape[1:]), channel.otherwise, F)
    out[has_point] = of_points[vertices.point_of_corner[has_point]]
    return out


class PointShares(Record):
    """The points of each of V vertices: K pairs of a vertex and a point."""

    vertex: NDArray[np.int64]  # (K,)
    point: NDArray[np.int64]  # (K,)
    angle: NDArray[np.float64]  # (K,) of the corners that the point gives their value [rad]
    total: NDArray[np.float64]  # (V,) sum of the angles; 0 at vertices without a point

    @classmethod
    def of(cls, vertices: Vertices) -> PointShares:
        """The shares of the points in their vertices."""
        sides, points = vertices.sides, len(vertices.points.key) + 1
        pair, back = np.unique(sides.vertex * np.int64(points) + sides.point, return_inverse=True)
        at, point = np.divmod(pair, points)
        angle = np.bincount(back.ravel(), sides.angle, len(pair)).astype(np.float64)
        return cls(at, point, angle, np.bincount(at, angle, vertices.count).astype(np.float64))

    def mean(self, channel: Channel, of_points: NDArray[np.float32]) -> NDArray[np.float32]:
        """A channel of vertices, (V,) or (V, 3), from that of points, (M,) or (M, 3)."""
        if channel.kind == "direction":
            sums = np.stack([self._sum(component[self.point]) for component in of_points.T], axis=1)
            return unit(np.where(self.total[:, None] > 0, sums, channel.otherwise)).astype(F)
        if channel.kind == "error":  # different points err independently
            sums = np.sqrt(self._sum(self.angle * np.square(of_points[self.point], dtype=np.float64)))
        else:
            sums = self._sum(of_points[self.point])
        otherwise = np.full(len(self.total), channel.otherwise)
        return np.divide(sums, self.total, out=otherwise, where=self.total > 0).astype(F)

    def _sum(self, values: NDArray[Any]) -> NDArray[np.float64]:
        """(V,) sums over each vertex, weighted by angle, of the values at pairs, (K,)."""
        return np.bincount(self.vertex, self.angle * values, len(self.total)).astype(np.float64)
