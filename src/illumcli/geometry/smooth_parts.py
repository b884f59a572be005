"""Smooth parts: triangles connected, directly or through others, by corners of equal position and normal.

A mesh file may hold several bodies, and a body several smooth surfaces between sharp edges. A triangle of
another smooth part can cast a shadow; one of the same part is the surface itself.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Ids, take_rows
from illumcli.geometry.components import components
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry

NORMAL_STEPS = 512
"""Normals that round to the same multiples of 1 / NORMAL_STEPS are equal: where exporters split a vertex,
they write its normal several times, with different last digits."""


class SmoothParts:
    """Tests whether triangles belong to one smooth part; the parts are computed when first needed."""

    def __init__(self, geometry: SceneGeometry, normals: CornerVectors) -> None:
        self._geometry = geometry
        self._normals = normals

    def are_joined(self, a: Ids, b: Ids) -> NDArray[np.bool_]:
        """(N,) True where stored triangles `a` and `b`, both (N,), belong to one smooth part of a mesh."""
        objects = self._geometry.objects
        out: NDArray[np.bool_] = objects.take(a) == objects.take(b)
        # Neighbours, which most pairs are, need no search for parts.
        others = np.flatnonzero(out & ~self._share_corner(a, b))
        if others.size:
            out[others] = self._part.take(a.take(others)) == self._part.take(b.take(others))
        return out

    def _share_corner(self, a: Ids, b: Ids) -> NDArray[np.bool_]:
        """(N,) True where a corner of `a` and one of `b` have the same vertex and normal."""
        vertex, normal = self._geometry.triangles, self._normals.index
        first, second = take_rows(self._geometry.corners, a), take_rows(self._geometry.corners, b)
        is_same = take_rows(vertex, a)[:, :, None] == take_rows(vertex, b)[:, None, :]
        is_same &= normal.take(first)[:, :, None] == normal.take(second)[:, None, :]
        return is_same.any(axis=(1, 2))

    @cached_property
    def _part(self) -> NDArray[np.integer[Any]]:
        """(T,) a number for the part of each triangle; threads that compute it at once get the same."""
        corner = self._corner_points()
        first, second = corner[:, :2].T.ravel(), corner[:, 1:].T.ravel()
        return components(first, second, int(corner.max(initial=-1)) + 1).take(corner[:, 0])

    def _corner_points(self) -> NDArray[np.int32]:
        """(T, 3) a number for the mesh, position and normal of each corner; equal corners share it."""
        # Pairs of a vertex and a normal; those of equal mesh, position and rounded normal share a number.
        geometry = self._geometry
        pair, vertex, row = self._pairs()
        first = [placed.first_vertex for placed in geometry.placed]
        of_vertex = np.searchsorted(first, np.arange(len(geometry.vertices)), side="right") - 1
        # Adding 0 gives zeros of both signs the same bits.
        x, y, z = (
            (column.take(vertex) + F(0)).view(np.uint32).astype(np.int64) for column in geometry.vertices.T
        )
        a, b, c = (
            (np.rint(column.take(row) * NORMAL_STEPS) + NORMAL_STEPS).astype(np.int64)
            for column in self._normals.values.T
        )
        return _number(x << 32 | y, of_vertex.take(vertex) << 32 | z, a << 32 | b << 16 | c).take(pair)

    def _pairs(self) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Pairs of a vertex and a normal: (T, 3) that of each corner, (K,) their vertices, (K,) their rows.

        Most often a vertex has one normal, or a normal one vertex, and the pairs need no search.
        """
        triangles, rows = self._geometry.triangles, len(self._normals.values)
        index = self._normals.index.take(self._geometry.corners)
        row = np.zeros(len(self._geometry.vertices), np.int32)
        row[triangles] = index
        if (row.take(triangles) == index).all():
            return triangles, np.arange(len(row)), row
        vertex = np.zeros(rows, np.int32)
        vertex[index] = triangles
        if (vertex.take(index) == triangles).all() and index.min() >= 0:
            return index, vertex, np.arange(rows)
        known, pair = np.unique(triangles * np.int64(rows) + index % rows, return_inverse=True)
        return pair.reshape(-1, 3), *np.divmod(known, rows)


def _number(*keys: NDArray[np.int64]) -> NDArray[np.int32]:
    """(N,) a number for each distinct combination of keys, each (N,), from 0."""
    order = np.lexsort(keys)
    new = np.zeros(len(order), np.bool_)
    for key in keys:
        ordered = key.take(order)
        new[1:] |= ordered[1:] != ordered[:-1]
    out = np.empty(len(order), np.int32)
    out[order] = np.cumsum(new)
    return out
