"""Smooth parts: triangles joined, directly or through others, by corners that share place and normal.

A mesh file may hold several bodies, and a body several smooth surfaces between sharp edges. What lies on
another smooth part is another thing that can cast a shadow; what lies on the same part is the surface itself.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Ids
from illumcli.geometry.assemble import CornerVectors, World

NORMAL_STEPS = 512
"""Normals that round to the same multiples of 1 / NORMAL_STEPS are one: exporters write the normal of a
vertex that they split several times, with different last digits."""


class SmoothParts:
    """Which triangles belong to one smooth part; the parts are looked for when a question needs them."""

    def __init__(self, world: World, normals: CornerVectors) -> None:
        self._world = world
        self._normals = normals

    def joined(self, a: Ids, b: Ids) -> NDArray[np.bool_]:
        """(N,) True where triangles `a` and `b`, both (N,), belong to one smooth part."""
        objects = self._world.objects
        out: NDArray[np.bool_] = objects.take(a) == objects.take(b)
        # Neighbours, which most pairs are, need no search for parts.
        apart = np.flatnonzero(out & ~self._share_corner(a, b))
        if apart.size:
            out[apart] = self._part.take(a.take(apart)) == self._part.take(b.take(apart))
        return out

    def _share_corner(self, a: Ids, b: Ids) -> NDArray[np.bool_]:
        world, out = self._world, np.zeros(len(a), np.bool_)
        for i in range(3):
            for j in range(3):
                first, second = world.corners[:, i].take(a), world.corners[:, j].take(b)
                place = world.triangles[:, i].take(a) == world.triangles[:, j].take(b)
                out |= place & (self._normals.index.take(first) == self._normals.index.take(second))
        return out

    @cached_property
    def _part(self) -> Ids:
        """(T,) lowest triangle number of each triangle's part; threads that ask at once find the same."""
        world = self._world
        count = len(world.triangles)
        # Number the distinct (object, place, normal) of all corners, triangle by triangle.
        place = _number_rows(world.vertices)
        direction = _number_rows(np.rint(self._normals.values * NORMAL_STEPS).astype(np.int32))
        keys = (
            np.repeat(world.objects, 3),
            place.take(world.triangles.ravel()),
            direction.take(self._normals.index.take(world.corners.ravel())),
        )
        point = _number_rows(np.stack(keys, axis=1))
        order = np.argsort(point, kind="stable")
        owner, first = order // 3, np.flatnonzero(np.diff(point[order], prepend=-1))
        # Spread the lowest number over shared corners until nothing changes; jumps shorten long chains.
        part = np.arange(count, dtype=np.int32)
        while True:
            lowest = np.minimum.reduceat(part.take(owner), first)
            new = lowest.take(point).reshape(-1, 3).min(axis=1)
            new = new.take(new)
            if np.array_equal(new, part):
                return part
            part = new


def _number_rows(table: NDArray[Any]) -> NDArray[np.int64]:
    """(N,) number of each row of an (N, k) table; equal rows share one. Zeros of either sign are equal."""
    order = np.lexsort(table.T)
    new = np.zeros(len(table), np.bool_)
    for column in table.T:
        ordered = column.take(order)
        new[1:] |= ordered[1:] != ordered[:-1]
    out = np.empty(len(table), np.int64)
    out[order] = np.cumsum(new)
    return out
