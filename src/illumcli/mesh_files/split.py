"""Splits vertices whose corners differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.records import Record


class SplitVertices(Record):
    """N vertices: those of a mesh, then copies for further combinations of their corners' values."""

    source: NDArray[np.int64]  # (N,) the vertex of the mesh that each one is, or is a copy of
    corner: NDArray[np.int64]  # (N,) one of its corners, -1 for vertices of no polygon
    of_corner: NDArray[np.int32]  # (C,) the vertex of each corner, among the N

    def columns(
        self, columns: Mapping[str, NDArray[Any]], at_corners: Mapping[str, NDArray[Any]]
    ) -> dict[str, NDArray[Any]]:
        """(N, ...) values of the vertices by name: those of a corner if it has any, otherwise of the vertex.

        Parameters
        ----------
        columns : mapping of (V, ...)
        at_corners : mapping of (C, ...)
            By the names of columns that corners have, too.
        """
        has_corner = np.flatnonzero(self.corner >= 0)
        split = {name: column[self.source] for name, column in columns.items()}
        for name in split.keys() & at_corners.keys():
            split[name][has_corner] = at_corners[name][self.corner[has_corner]]
        return split


def split_vertices(
    corners: NDArray[np.integer[Any]], count: int, tables: Sequence[NDArray[Any]]
) -> SplitVertices:
    """Each of `count` vertices, and a copy for every further combination of rows of `tables` at its corners.

    Parameters
    ----------
    corners : (C,) int
        The vertex of each corner.
    tables : sequence of (C, k)
        Normals, uv or values of each corner.
    """
    # The vertices whose corners all have the rows of the first one are not split.
    first_corner = np.full(count, -1, np.int64)
    first_corner[corners[::-1]] = np.arange(len(corners) - 1, -1, -1)
    several = np.zeros(count, np.bool_)
    for table in tables:
        other = (table != table[first_corner[corners]]).any(axis=1)
        several[corners[other]] = True
    rest = np.flatnonzero(several[corners])
    of_corner = corners.astype(np.int32)
    if not len(rest):
        return SplitVertices(np.arange(count), first_corner, of_corner)

    # Number the combinations of each other vertex and its rows.
    key = corners[rest].astype(np.int64)
    for table in tables:
        _, row = np.unique(table[rest], axis=0, return_inverse=True)
        _, key = np.unique(key * (len(rest) + 1) + row.ravel(), return_inverse=True)
        key = key.ravel()
    _, first, key = np.unique(key, return_index=True, return_inverse=True)

    # The first combination of a vertex keeps the vertex's index; the others follow after all vertices.
    order = np.argsort(first, kind="stable")
    vertex = corners[rest[first[order]]]
    is_first = np.zeros(len(order), bool)
    is_first[np.unique(vertex, return_index=True)[1]] = True
    number = np.empty(len(order), np.int32)
    number[order] = np.where(is_first, vertex, count + np.cumsum(~is_first) - 1)
    of_corner[rest] = number[key.ravel()]
    copies = order[~is_first]
    return SplitVertices(
        np.concatenate([np.arange(count), vertex[~is_first]]),
        np.concatenate([first_corner, rest[first[copies]]]),
        of_corner,
    )
