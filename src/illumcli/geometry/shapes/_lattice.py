"""Meshes over a lattice of nodes: rows from bottom to top, columns to the right, seams and poles welded."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Vectors
from illumcli.geometry.mesh import Mesh
from illumcli.records import Record


class Lattice(Record):
    """Nodes of R rows and C columns, each with its own normal and uv; equal vertex numbers are one vertex.

    Normals point to the side from which columns run to the right and rows upwards.
    """

    points: NDArray[np.float64]  # (R, C, 3)
    normals: Vectors  # (R, C, 3) unit; zero where the surface has none
    uvs: NDArray[np.float64]  # (R, C, 2)
    vertex: NDArray[np.int64]  # (R, C) any numbers below R * C


def vertex_numbers(
    rows: NDArray[np.int64],
    columns: NDArray[np.int64],
    row_is_point: NDArray[np.bool_] | None = None,
    column_is_point: NDArray[np.bool_] | None = None,
) -> NDArray[np.int64]:
    """(R, C) vertex numbers from the numbers of rows (R,) and columns (C,); equal numbers are welded.

    All nodes of a row that is a point, (R,) bool, or of such a column, (C,) bool, are one vertex.
    """
    row, column = np.meshgrid(rows, columns, indexing="ij")
    if row_is_point is not None:
        column[row_is_point] = 0
    if column_is_point is not None:
        row[:, column_is_point] = 0
    return row * len(columns) + column


def around(count: int) -> NDArray[np.int64]:
    """(count + 1,) numbers of columns or rows, the last of which is the first again."""
    return np.append(np.arange(count), 0)


def turned(lattice: Lattice) -> Lattice:
    """The same surface seen from its other side."""
    columns = slice(None, None, -1)
    return Lattice(
        lattice.points[:, columns],
        -lattice.normals[:, columns],
        lattice.uvs[:, columns],
        lattice.vertex[:, columns],
    )


def woven(*lattices: Lattice) -> Mesh:
    """One mesh of the quads between nodes; triangles where a side is a single vertex, as at poles."""
    # Vertices and corners of every lattice, numbered one lattice after the other.
    parts = [_part(lattice) for lattice in lattices]
    vertices, corners, nodes, sizes = (list(each) for each in zip(*parts, strict=True))
    first_vertex = _offsets([len(each) for each in vertices])
    first_node = _offsets([lattice.vertex.size for lattice in lattices])
    normals = np.concatenate([lattice.normals.reshape(-1, 3) for lattice in lattices]).astype(
        np.float64, copy=False
    )
    node = np.concatenate([each + first for each, first in zip(nodes, first_node, strict=True)]).astype(
        np.int32
    )
    has_normal = np.any(normals, axis=1)
    return Mesh(
        vertices=np.concatenate(vertices),
        corners=np.concatenate([c + f for c, f in zip(corners, first_vertex, strict=True)]).astype(np.int32),
        starts=np.concatenate([[0], np.cumsum(np.concatenate(sizes))]).astype(np.int32),
        normals=normals,
        corner_normals=node if has_normal.all() else np.where(has_normal[node], node, -1).astype(np.int32),
        uvs=np.concatenate([lattice.uvs.reshape(-1, 2) for lattice in lattices]),
        corner_uvs=node.copy(),
    )


def _offsets(counts: Sequence[int]) -> list[int]:
    return [0, *np.cumsum(counts).tolist()][:-1]


def _part(
    lattice: Lattice,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Vertices (V, 3); vertex and node of each corner (C,); corners of each polygon (P,)."""
    # The quads between nodes, without corners that repeat the next one.
    nodes = np.arange(lattice.vertex.size).reshape(lattice.vertex.shape)
    quads = np.stack([nodes[:-1, :-1], nodes[:-1, 1:], nodes[1:, 1:], nodes[1:, :-1]], axis=-1).reshape(-1, 4)
    number = lattice.vertex.ravel()[quads]
    kept = number != np.roll(number, -1, axis=1)
    kept &= kept.sum(axis=1, keepdims=True) >= 3
    sizes = kept.sum(axis=1)

    # The position of a vertex is that of its first node.
    used, corners = _renumbered(number[kept], lattice.vertex.size)
    first_node = np.empty(lattice.vertex.size, np.int64)  # of each vertex number
    first_node[lattice.vertex.ravel()[::-1]] = nodes.ravel()[::-1]
    return lattice.points.reshape(-1, 3)[first_node[used]], corners, quads[kept], sizes[sizes > 0]


def _renumbered(numbers: NDArray[np.int64], limit: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The distinct numbers, ascending, and the index of each number among them."""
    occurs = np.zeros(limit, bool)
    occurs[numbers] = True
    place = np.cumsum(occurs) - 1
    return np.flatnonzero(occurs), place[numbers]
