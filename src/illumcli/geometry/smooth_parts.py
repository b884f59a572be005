"""Smooth parts: triangles connected, directly or through others, by corners of equal position and normal.

A mesh file may hold several bodies, and a body several smooth surfaces between sharp edges. A triangle of
another smooth part can cast a shadow; one of the same part is the surface itself.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Ids
from illumcli.geometry.components import components
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry

NORMAL_STEPS = 512
"""Normals that round to the same multiples of 1 / NORMAL_STEPS are equal: where exporters split a vertex,
they write its normal several times, with different last digits."""


class SmoothParts:
    """Which triangles belong to one smooth part; the parts are computed when first needed."""

    def __init__(self, geometry: SceneGeometry, normals: CornerVectors) -> None:
        self._geometry = geometry
        self._normals = normals

    def are_joined(self, a: Ids, b: Ids) -> NDArray[np.bool_]:
        """(N,) True where triangles `a` and `b`, both (N,), belong to one smooth part."""
        objects = self._geometry.objects
        out: NDArray[np.bool_] = objects.take(a) == objects.take(b)
        # Neighbours, which most pairs are, need no search for parts.
        others = np.flatnonzero(out & ~self._share_corner(a, b))
        if others.size:
            out[others] = self._part.take(a.take(others)) == self._part.take(b.take(others))
        return out

    def _share_corner(self, a: Ids, b: Ids) -> NDArray[np.bool_]:
        geometry, out = self._geometry, np.zeros(len(a), np.bool_)
        for i in range(3):
            for j in range(3):
                first, second = geometry.corners[:, i].take(a), geometry.corners[:, j].take(b)
                same_vertex = geometry.triangles[:, i].take(a) == geometry.triangles[:, j].take(b)
                out |= same_vertex & (self._normals.index.take(first) == self._normals.index.take(second))
        return out

    @cached_property
    def _part(self) -> NDArray[np.int64]:
        """(T,) a number for the part of each triangle; threads that compute it at once get the same."""
        point = self._corner_points()
        first, second = point[:, :2].T.ravel(), point[:, 1:].T.ravel()
        return components(first, second, point.max(initial=-1) + 1).take(point[:, 0])

    def _corner_points(self) -> NDArray[np.int64]:
        """(T, 3) a number for the object, position and normal of each corner; equal corners share it."""
        # Number the positions, apart for each object.
        geometry = self._geometry
        of_vertex = np.zeros(len(geometry.vertices), np.int64)
        of_vertex[geometry.triangles] = geometry.objects[:, None]
        # + 0.0 makes zeros of both signs the same bits
        x, y, z = ((column + F(0)).view(np.uint32).astype(np.int64) for column in geometry.vertices.T)
        position = _number(x << 32 | y, of_vertex << 32 | z)

        # Number the rounded normals, then the pairs of both.
        a, b, c = (np.rint(self._normals.values.T * NORMAL_STEPS) + NORMAL_STEPS).astype(np.int64)
        direction = _number(a << 32 | b << 16 | c)
        corner = direction.take(self._normals.index.take(geometry.corners))
        return _number(
            (position.take(geometry.triangles) * (corner.max(initial=0) + 1) + corner).ravel()
        ).reshape(-1, 3)


def _number(*keys: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N,) a number for each distinct combination of keys, each (N,), from 0."""
    order = np.lexsort(keys)
    new = np.zeros(len(order), np.bool_)
    for key in keys:
        ordered = key.take(order)
        new[1:] |= ordered[1:] != ordered[:-1]
    out = np.empty(len(order), np.int64)
    out[order] = np.cumsum(new)
    return out
