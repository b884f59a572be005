"""Matrices that place an object in the scene."""

from __future__ import annotations

from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import cross
from illumcli.geometry.extent import Extent, box_corners, take_used
from illumcli.geometry.mesh import Mesh


class Transform(Protocol):
    """How a scene places an object; see the scene's own `Transform`."""

    @property
    def scale(self) -> tuple[float, float, float]: ...
    @property
    def rotate(self) -> tuple[float, float, float]: ...  # about x, then y, then z [degrees]
    @property
    def fit(self) -> float | None: ...  # half the diagonal of the fitted box [scene units]
    @property
    def translate(self) -> tuple[float, float, float]: ...  # [scene units]
    @property
    def matrix(self) -> tuple[tuple[float, float, float, float], ...] | None: ...  # rows, applied last


def transform_matrix(transform: Transform, mesh: Mesh, extent: Extent | None = None) -> NDArray[np.float64]:
    """(4, 4) float64, object to scene: scale, rotate about x, y, z, fit, translate, then the matrix.

    `extent` is that of the mesh, if it is known.
    """
    matrix = np.diag([*transform.scale, 1.0])
    for axis, degrees in enumerate(transform.rotate):
        matrix = rotation(axis, degrees) @ matrix
    if transform.fit is not None and len(mesh.corners):
        if extent is None:
            low, high = box_corners(take_used(mesh, mesh.vertices) @ matrix[:3, :3].T)
        else:
            low, high = extent.box(matrix[:3, :3])
        size = transform.fit / (np.linalg.norm((high - low) / 2) or 1.0)
        matrix[:3, :3] *= size
        matrix[:3, 3] = -size * np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    matrix[:3, 3] += transform.translate
    return matrix if transform.matrix is None else np.asarray(transform.matrix, np.float64) @ matrix


@lru_cache(maxsize=1 << 10)
def rotation(axis: int, degrees: float) -> NDArray[np.float64]:
    """(4, 4) right-handed rotation about a coordinate axis, read-only; quarter turns are exact."""
    quarter, rest = divmod(degrees, 90.0)
    cosine, sine = np.cos(np.radians(rest)), np.sin(np.radians(rest))
    for _ in range(int(quarter) % 4):
        cosine, sine = -sine, cosine
    i, j = ((1, 2), (2, 0), (0, 1))[axis]
    matrix = np.eye(4)
    matrix[i, i] = matrix[j, j] = cosine
    matrix[j, i], matrix[i, j] = sine, -sine
    matrix.setflags(write=False)
    return matrix


def cofactors(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) cofactor matrix: det times the inverse transpose, defined for singular matrices too."""
    return np.ascontiguousarray(cross(matrix[[1, 2, 0]], matrix[[2, 0, 1]]))
