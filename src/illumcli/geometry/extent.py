"""Bounding boxes of a mesh under many matrices, each from the few vertices that may reach farthest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.spatial_order import compact

CLUSTER = 64
"""Neighbouring vertices that one box bounds."""
MANY = 16
"""Objects of a mesh from which on clusters pay off, and clusters of a mesh."""
ROUNDING = 1e-12
"""Relative rounding of a cluster's reach."""

Box = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Lowest and highest corner, (3,) each."""


def box_corners(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest corner, (3,) each, of the box around (N, 3) points; the origin if there are none."""
    if not len(points):
        return np.zeros(3), np.zeros(3)
    # By columns: along the other axis numpy processes three numbers at a time.
    low, high = ([reach(column) for column in points.T] for reach in (np.min, np.max))
    return np.array(low), np.array(high)


def take_used(mesh: Mesh, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points, of (V, 3) for all vertices of the mesh, whose vertices polygons use."""
    mask = used_vertices(mesh)
    return points if mask.all() else points[mask]


def used_vertices(mesh: Mesh) -> NDArray[np.bool_]:
    """(V,) True for vertices that polygons use."""
    mask = np.zeros(len(mesh.vertices), np.bool_)
    mask[mesh.corners] = True
    return mask


class Extent:
    """The used vertices of a mesh in clusters of neighbours.

    Its boxes have the same bits as those of all transformed vertices.
    """

    def __init__(self, vertices: NDArray[np.float64]) -> None:
        order = compact(vertices)
        padded = np.append(order, np.repeat(order[-1:], -len(order) % CLUSTER))
        self._clusters = np.ascontiguousarray(vertices[padded].T).reshape(3, -1, CLUSTER)
        low, high = self._clusters.min(axis=2), self._clusters.max(axis=2)
        self._centre, self._half = (low + high) / 2, (high - low) / 2  # (3, K)
        self._size = np.abs([low.min(axis=1), high.max(axis=1)]).max(axis=0)

    def box(self, linear: NDArray[np.float64], translation: NDArray[np.float64] | float = 0.0) -> Box:
        """The box of the vertices under a (3, 3) matrix and a translation."""
        # How far the box of each cluster reaches along the axes, and how far the foremost clusters do.
        middle, reach = linear @ self._centre, np.abs(linear) @ self._half
        low, high = middle - reach, middle + reach
        lowest, highest = self._among(linear, np.append(low.argmin(axis=1), high.argmax(axis=1)))

        # Those that may reach farther than these.
        slack = ROUNDING * (np.abs(linear) @ self._size)
        candidates = (low <= (lowest + slack)[:, None]) | (high >= (highest - slack)[:, None])
        lowest, highest = self._among(linear, np.flatnonzero(candidates.any(axis=0)))
        return lowest + translation, highest + translation

    def _among(self, linear: NDArray[np.float64], which: NDArray[np.intp]) -> Box:
        """The box of the vertices of some clusters under a matrix."""
        points = linear @ self._clusters[:, which].reshape(3, -1)
        return points.min(axis=1), points.max(axis=1)


def extents(meshes: Sequence[Mesh]) -> Mapping[int, Extent]:
    """The extents of meshes that many objects have, by the `id` of the mesh."""
    count = Counter(map(id, meshes))
    many = {
        id(mesh): mesh
        for mesh in meshes
        if count[id(mesh)] >= MANY and len(mesh.vertices) >= MANY * CLUSTER and len(mesh.corners)
    }
    return {key: Extent(take_used(mesh, mesh.vertices)) for key, mesh in many.items()}
