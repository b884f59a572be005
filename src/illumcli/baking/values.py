"""From the points that a bake asks to the corners and vertices that hold its values."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Vectors
from illumcli.baking.points import Vertices
from illumcli.visibility.baked import Baked


def baked_values(
    vertices: Vertices, w: NDArray[np.float32], error: NDArray[np.float32], bent: Vectors | None
) -> Baked:
    """Values at vertices, and at corners where some vertex has several normals.

    A vertex has the mean over its corners, weighed by angle. What has no point is open, with error 0.

    Parameters
    ----------
    w, error : (M,)
        Of each point, and its standard error.
    bent : (M, 3), optional
        Unit mean direction of what is open.
    """
    # the share of each point in its vertices; different points err independently
    sides = vertices.sides
    pair, back = np.unique(sides.vertex * np.int64(len(w) + 1) + sides.row, return_inverse=True)
    at, point = np.divmod(pair, len(w) + 1)
    share = np.bincount(back.ravel(), sides.angle, len(pair))
    whole = np.bincount(at, share, vertices.count)

    def mean(values: NDArray[Any]) -> NDArray[np.float64]:
        sums = np.bincount(at, share * values[point], vertices.count)
        return np.divide(sums, whole, out=np.ones(vertices.count), where=whole > 0)

    variance = np.bincount(at, np.square(share * error[point].astype(np.float64)), vertices.count)
    spread = np.divide(np.sqrt(variance), whole, out=np.zeros(vertices.count), where=whole > 0)
    normals = None
    if bent is not None:
        normals = np.stack([np.where(whole > 0, mean(component), 0) for component in bent.T], axis=1)
        size = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = np.divide(normals, size, out=np.zeros_like(normals), where=size > 0).astype(F)
    made = Baked(mean(w).astype(F), spread.astype(F), normals)
    if len(pair) == np.count_nonzero(whole):
        return made

    # some vertex has several
    has = np.flatnonzero(vertices.row >= 0)

    def of_corners(values: NDArray[Any], otherwise: float) -> NDArray[np.float32]:
        out = np.full((len(vertices.row), *values.shape[1:]), otherwise, F)
        out[has] = values[vertices.row[has]]
        return out

    return replace(
        made,
        corner_obscurance=of_corners(w, 1.0),
        corner_standard_error=of_corners(error, 0.0),
        corner_bent_normal=None if bent is None else of_corners(bent, 0.0),
    )
