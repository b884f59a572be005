"""From the points of a bake to the corners and vertices that take their values."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.baking.context import PointValues
from illumcli.visibility.baked import Baked


def baked_values(values: PointValues) -> Baked:
    """Values at vertices, and at corners where some vertex has several points.

    A vertex has the mean over its corners, weighted by angle. Vertices without a point are open, with error
    0.
    """
    # the share of each point in its vertices; different points err independently
    vertices, w, error = values.vertices, values.w, values.error
    sides = vertices.sides
    pair, back = np.unique(sides.vertex * np.int64(len(w) + 1) + sides.point, return_inverse=True)
    at, point = np.divmod(pair, len(w) + 1)
    share = np.bincount(back.ravel(), sides.angle, len(pair))
    total = np.bincount(at, share, vertices.count)

    def mean(of_points: NDArray[Any]) -> NDArray[np.float64]:
        sums = np.bincount(at, share * of_points[point], vertices.count)
        return np.divide(sums, total, out=np.ones(vertices.count), where=total > 0)

    # means over each vertex
    variance = np.bincount(at, np.square(share * error[point].astype(np.float64)), vertices.count)
    spread = np.divide(np.sqrt(variance), total, out=np.zeros(vertices.count), where=total > 0)
    normals = None
    if values.bent is not None:
        normals = np.stack([np.where(total > 0, mean(component), 0) for component in values.bent.T], axis=1)
        size = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = np.divide(normals, size, out=np.zeros_like(normals), where=size > 0).astype(F)
    baked = Baked(mean(w).astype(F), spread.astype(F), normals)
    if len(pair) == np.count_nonzero(total):
        return baked

    # some vertex has several points: corners have values of their own
    has_point = np.flatnonzero(vertices.point_of_corner >= 0)

    def of_corners(of_points: NDArray[Any], otherwise: float) -> NDArray[np.float32]:
        out = np.full((len(vertices.point_of_corner), *of_points.shape[1:]), otherwise, F)
        out[has_point] = of_points[vertices.point_of_corner[has_point]]
        return out

    return replace(
        baked,
        corner_obscurance=of_corners(w, 1.0),
        corner_standard_error=of_corners(error, 0.0),
        corner_bent_normal=None if values.bent is None else of_corners(values.bent, 0.0),
    )
