"""Array types, and the few array and vector operations that all folders share.

The first axis counts elements: samples, vertices, polygons. Vectors are (N, 3) arrays in Fortran order, so
that each component is contiguous: multiplying them by a weight per element is about six times faster than in
C order, and elementwise results keep the order of their operands.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

F = np.float32

Floats: TypeAlias = NDArray[np.floating[Any]]  # (N,)
Vectors: TypeAlias = NDArray[np.floating[Any]]  # (N, 3)
Ids: TypeAlias = NDArray[np.int32]  # (N,)

BLOCK_ROWS = 3 << 13
"""Rows of a block; a multiple of the rows that matrix products process at a time."""


def column_major(values: ArrayLike, dtype: DTypeLike | None = None) -> NDArray[Any]:
    """`values` in Fortran order, each component contiguous; copied only if they are not so already."""
    return np.asarray(values, dtype=dtype, order="F")


def take_rows(table: NDArray[Any], index: NDArray[Any]) -> NDArray[Any]:
    """``table[index]`` for an array of indices along the first axis; components stay contiguous.

    `take` on the transposed table is three to four times faster than ``table[index]``. The mode `wrap` gives
    valid indices, negative ones too, the same meaning, but skips the check of their range, which doubles the
    speed again.
    """
    if table.ndim == 1:
        return table.take(index, mode="wrap")
    return table.T.take(index, axis=1, mode="wrap").T


def take_or_all(table: NDArray[Any], index: NDArray[Any]) -> NDArray[Any]:
    """``table[index]`` for ascending indices without repeats; `table` itself, not copied, if they are all."""
    return table if len(index) == len(table) else take_rows(table, index)


def repeat_rows(vectors: Vectors, count: int) -> Vectors:
    """(N * count, 3) each vector `count` times in a row; done per component, which is much faster."""
    return np.repeat(vectors.T, count, axis=1).T


def row_blocks(count: int) -> Iterator[slice]:
    """Blocks of `count` rows, for work whose intermediate arrays should stay in a processor's cache.

    No block is a single row unless there is only one: the rounding of matrix products of several rows does
    not depend on where a block begins, but products of a single row are computed differently.
    """
    firsts = range(0, max(count - 1, min(count, 1)), BLOCK_ROWS)
    for first in firsts:
        yield slice(first, count if first == firsts[-1] else first + BLOCK_ROWS)


def dot(a: Vectors, b: Vectors) -> Floats:
    """(N,) a . b per element; summed in a fixed order, so that no result depends on its neighbours."""
    out = a[:, 0] * b[:, 0]
    product = a[:, 1] * b[:, 1]
    out += product
    out += np.multiply(a[:, 2], b[:, 2], out=product)
    return out


def cross(a: Vectors, b: Vectors) -> Vectors:
    """(N, 3) a x b per element."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape), np.result_type(a, b), order="F")
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.subtract(a[:, j] * b[:, k], a[:, k] * b[:, j], out=out[:, i])
    return out


def length(a: Vectors) -> Floats:
    """(N,) Euclidean lengths in the precision of `a`, which also decides underflow and overflow."""
    square = dot(a, a)
    return np.sqrt(square, out=square)


def unit(a: Vectors) -> Vectors:
    """(N, 3) `a` scaled to length 1; zero vectors remain zero."""
    size = length(a)
    np.maximum(size, np.finfo(size.dtype).tiny, out=size)
    return a * np.divide(1, size, out=size)[:, None]


def mirror(l: Vectors, n: Vectors, n_l: Floats) -> Vectors:
    """(N, 3) r = 2 (n . l) n - l, `l` mirrored at the unit vector `n`."""
    r = (2 * n_l)[:, None] * n
    r -= l
    return r


def perpendicular(n: Vectors) -> tuple[tuple[Floats, Floats, Floats], tuple[Floats, Floats, Floats]]:
    """The components of two unit vectors that are at right angles to each other and to unit vectors, (N, 3).

    References
    ----------
    Duff, T. et al. (2017). Building an orthonormal basis, revisited. JCGT 6(1).
    """
    x, y, z = n[:, 0], n[:, 1], n[:, 2]
    sign = np.copysign(z.dtype.type(1), z)
    a = -1 / (sign + z)
    b = x * y * a
    return (1 + sign * x * x * a, sign * b, -sign * x), (b, sign + y * y * a, -y)


def as_dtype_of(values: NDArray[Any], *parameters: object) -> list[NDArray[Any]]:
    """The parameters as arrays in the precision of `values`, (N,).

    A parameter is a number or colour of the scene, or one value per element where it varies over the
    surface; scalars broadcast against ``values``, colours against ``values[:, None]``.
    """
    return [np.asarray(parameter, values.dtype) for parameter in parameters]
