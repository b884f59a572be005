"""Instances: objects that share the elements of one mesh, each under a matrix of its own.

The mesh is stored once, in a space of its own: recentred and scaled to unit radius in float64, and mirrored
for objects that mirror it, so that no instance's matrix turns triangles round.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, cross, take_rows, unit
from illumcli.records import Record
from illumcli.render_space import RenderSpace

MOST_STRETCH = 3.0
"""Greatest ratio of the longest to the shortest axis of an instance's matrix. Embree inverts the matrix in
single precision, so errors grow with the ratio. Up to 3 no ray hits the convex body that it leaves; at 10, 1
in 10,000 does, at 30, 1 in 2,000."""
REACH = 6.0
"""Radii of an instance that its ray offsets are proportional to, beside the distance of its centre from the
scene's: the error of a ray in the mesh's space grows with both. Of 3 million rays that leave large faces,
half of them within 0.1 rad of the face, 9 hit it again with 2 radii, none with 6."""
SIMILAR = 1.0
"""The same for meshes with polygons of more than four corners: mean value coordinates, by which these are
interpolated, change where a polygon is stretched; those of triangles and quads do not."""
ROUNDING = 1e-9
"""Relative rounding of a ratio of axes."""


Move: TypeAlias = Callable[[Ids, Vectors], Vectors]
"""Rows of N instances and a vector of each, (N, 3) -> the vectors in render space."""


class Instances(Record):
    """The I objects of a scene's O that share a mesh. Arrays are read-only."""

    number: NDArray[np.int32]  # (O,) row of each object among the instances, -1 for objects that are none
    object: NDArray[np.int32]  # (I,)
    placed: NDArray[np.int32]  # (I,) which placed mesh each shares
    matrix: NDArray[np.float32]  # (I, 3, 4) from the mesh's own space to render space, as Embree has it
    normal_matrix: NDArray[np.float32]  # (I, 3, 3) the same for normals, up to their length
    reach: NDArray[np.float32]  # (I,) least length that ray offsets are proportional to [radii]

    def __post_init__(self) -> None:
        for array in vars(self).values():
            array.setflags(write=False)

    def positions(self, row: Ids, points: Vectors) -> Vectors:
        """(N, 3) `points` of instances in render space; those of row -1 are there already."""
        return self._moved(row, points, lambda row, local: _affine(self.matrix, row, local))

    def normals(self, row: Ids, n: Vectors) -> Vectors:
        """(N, 3) unit normals `n` of instances in render space; a zero vector stays zero."""
        return self._moved(row, n, lambda row, local: unit(_linear(self.normal_matrix, row, local)))

    def directions(self, row: Ids, d: Vectors) -> Vectors:
        """(N, 3) unit directions `d` along instances in render space; a zero vector stays zero."""
        return self._moved(row, d, lambda row, local: unit(_linear(self.matrix, row, local)))

    def edges(self, row: Ids, edge: Floats) -> Floats:
        """(N,) `edge`, on instances at least `reach`."""
        return np.maximum(edge, np.where(row >= 0, self.reach.take(row, mode="wrap"), F(0)))

    def _moved(self, row: Ids, vectors: Vectors, move: Move) -> Vectors:
        index = np.flatnonzero(row >= 0)
        if not index.size:
            return vectors
        if index.size == len(row):
            return move(row, vectors)
        out = vectors.copy(order="F")
        out[index] = move(row.take(index), take_rows(vectors, index))
        return out


class Shared(Record):
    """Objects that share one mesh."""

    objects: tuple[int, ...]
    mirrored: bool


def shared_meshes(
    kinds: Sequence[int], matrices: Sequence[NDArray[np.float64]], most_corners: NDArray[np.int64]
) -> list[Shared]:
    """The objects that share a mesh with another; those of other objects are stored one by one.

    It depends on the scene's description alone, so that culling an object changes no other.

    Parameters
    ----------
    kinds : sequence of int
        Equal for objects that have one mesh, and whose normals and uv are computed in one way.
    matrices : sequence of (4, 4) float64
        Object to scene, one for each object.
    most_corners : (O,) int64
        Of any polygon of each object.
    """
    if len(set(kinds)) == len(kinds):
        return []
    linear = np.stack(matrices)[:, :3, :3]
    axes = np.linalg.svd(linear, compute_uv=False)
    most = np.where(most_corners > 4, SIMILAR, MOST_STRETCH)
    is_mild = (axes[:, 0] <= most * (1 + ROUNDING) * axes[:, 2]) & (axes[:, 2] > 0)
    is_mirrored = np.linalg.det(linear) < 0
    keys = [*zip(kinds, is_mirrored.tolist(), strict=True)]
    count = Counter(key for key, mild in zip(keys, is_mild, strict=True) if mild)
    members: dict[tuple[int, bool], list[int]] = {}
    for i, (key, mild) in enumerate(zip(keys, is_mild, strict=True)):
        if mild and count[key] > 1:
            members.setdefault(key, []).append(i)
    return [Shared(tuple(objects), mirrored) for (_, mirrored), objects in members.items()]


def instance_matrices(
    matrices: NDArray[np.float64], own: RenderSpace, render_space: RenderSpace
) -> NDArray[np.float64]:
    """(I, 3, 4) from a mesh's own space to render space; `matrices`, (I, 4, 4), lead to the scene."""
    linear = matrices[:, :3, :3] * (own.radius / render_space.radius)
    centre = render_space.from_world(matrices[:, :3, :3] @ own.centre + matrices[:, :3, 3])
    return np.concatenate([linear, centre[:, :, None]], axis=2)


def instances(
    count: int, objects: NDArray[np.int32], placed: NDArray[np.int32], matrices: NDArray[np.float64]
) -> Instances | None:
    """The instances among `count` objects; None if there are none.

    Parameters
    ----------
    objects, placed : (I,) int32
        The number of each instance's object, and of the placed mesh that it shares.
    matrices : (I, 3, 4) float64
        From the mesh's own space to render space.
    """
    if not len(objects):
        return None
    number = np.full(count, -1, np.int32)
    number[objects] = np.arange(len(objects), dtype=np.int32)
    radius = np.linalg.svd(matrices[:, :, :3], compute_uv=False)[:, 0]
    linear = matrices[:, :, :3] / radius[:, None, None]
    cofactors = [cross(linear[:, (k + 1) % 3], linear[:, (k + 2) % 3]) for k in range(3)]
    normal = np.stack(cofactors, axis=1)
    reach = np.linalg.norm(matrices[:, :, 3], axis=1) + REACH * radius
    return Instances(number, objects, placed, matrices.astype(F), normal.astype(F), reach.astype(F))


def _linear(matrix: NDArray[Any], row: Ids, vectors: Vectors) -> Vectors:
    """(N, 3) each vector by the first three columns of its matrix."""
    out = np.empty(vectors.shape, np.result_type(matrix, vectors), order="F")
    for component, weights in zip(out.T, matrix.transpose(1, 2, 0), strict=True):
        np.multiply(weights[0].take(row), vectors[:, 0], out=component)
        for k in (1, 2):
            component += weights[k].take(row) * vectors[:, k]
    return out


def _affine(matrix: NDArray[np.float32], row: Ids, points: Vectors) -> Vectors:
    """(N, 3) each point by its matrix, in double precision, rounded once to the precision of `points`."""
    exact = matrix.astype(np.float64)
    out = _linear(exact, row, points)
    for component, translation in zip(out.T, exact[:, :, 3].T, strict=True):
        component += translation.take(row)
    return out.astype(points.dtype, copy=False)
