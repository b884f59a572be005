"""Texels whose centres triangles cover.

A centre on an edge between two triangles belongs to exactly one of them: the crossing of an edge and a row of
centres is computed from the edge's ends in one order, for whichever triangle, and intervals are half open.

References
----------
Foley, J. D. et al. (1990). Computer Graphics: Principles and Practice, 2nd ed., section 3.6.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from illumcli.atlas.triangles import AtlasTriangles
from illumcli.records import Record

AT_ONCE = 1 << 18
"""Rows of triangles, and texels, that are computed together."""


class TexelsOnTriangles(Record):
    """K places on triangles, each the place of one texel."""

    texel: NDArray[np.int32]  # (K,) as `TextureSize.texel` numbers them
    number: NDArray[np.int32]  # (K,) of the triangle among the `AtlasTriangles`
    u: NDArray[np.float32]  # (K,) weight of corner 1
    v: NDArray[np.float32]  # (K,) weight of corner 2


def covered_centres(triangles: AtlasTriangles) -> TexelsOnTriangles:
    """A place for every texel and every triangle that covers its centre, triangle by triangle."""
    parts = [TexelsOnTriangles(*(np.zeros(0, kind) for kind in ("i4", "i4", "f4", "f4")))]
    for number, row, left, right in _spans(triangles):
        parts += [_texels(triangles, *span) for span in _pieces(number, row, left, right)]
    return joined(parts)


def joined(parts: list[TexelsOnTriangles]) -> TexelsOnTriangles:
    """The places of all parts, one part after the other."""
    names = ("texel", "number", "u", "v")
    return TexelsOnTriangles(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def runs(first: NDArray[np.int64], count: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The ``count[i]`` numbers from ``first[i]`` on of every run i, and the run of each."""
    run = np.repeat(np.arange(len(first)), count)
    before = np.cumsum(count) - count
    return first[run] + np.arange(len(run)) - before[run], run


def blocks(count: NDArray[np.int64]) -> Iterator[slice]:
    """Slices of the runs, of about `AT_ONCE` numbers each."""
    upto = np.cumsum(count)
    first = 0
    while first < len(count):
        before = int(upto[first - 1]) if first else 0
        end = max(int(np.searchsorted(upto, before + AT_ONCE, side="right")), first + 1)
        yield slice(first, end)
        first = end


def _spans(triangles: AtlasTriangles) -> Iterator[tuple[NDArray[np.int64], ...]]:
    """Rows of centres that triangles cross: number of the triangle, row, and the first and end column."""
    low, high = triangles.y.min(axis=0, initial=np.inf), triangles.y.max(axis=0, initial=-np.inf)
    first = np.ceil(low - 0.5).astype(np.int64)
    count = np.ceil(high - 0.5).astype(np.int64) - first
    for block in blocks(count):
        row, run = runs(first[block], count[block])
        number = run + block.start
        centre = row + 0.5
        left, right = np.full(len(row), np.inf), np.full(len(row), -np.inf)
        for k in range(3):
            # the edge from its upper end, and what a row adds to x
            ax, ay = triangles.x[k - 1][block], triangles.y[k - 1][block]
            bx, by = triangles.x[k][block], triangles.y[k][block]
            turned = by < ay
            ax, bx = np.where(turned, bx, ax), np.where(turned, ax, bx)
            ay, by = np.where(turned, by, ay), np.where(turned, ay, by)
            slope = np.divide(bx - ax, by - ay, out=np.zeros_like(ax), where=by > ay)
            crosses = (ay[run] <= centre) & (centre < by[run])
            x = ax[run] + (centre - ay[run]) * slope[run]
            left = np.where(crosses, np.minimum(left, x), left)
            right = np.where(crosses, np.maximum(right, x), right)
        begin, end = np.ceil(left - 0.5), np.ceil(right - 0.5)
        filled = np.flatnonzero(begin < end)
        yield number[filled], row[filled], begin[filled].astype(np.int64), end[filled].astype(np.int64)


def _pieces(
    number: NDArray[np.int64], row: NDArray[np.int64], left: NDArray[np.int64], right: NDArray[np.int64]
) -> Iterator[tuple[NDArray[np.int64], ...]]:
    """The spans in blocks, as column, row and number of the triangle of each texel."""
    count = right - left
    for block in blocks(count):
        column, run = runs(left[block], count[block])
        yield column, row[block][run], number[block][run]


def _texels(
    triangles: AtlasTriangles,
    column: NDArray[np.int64],
    row: NDArray[np.int64],
    number: NDArray[np.int64],
) -> TexelsOnTriangles:
    u, v = triangles.weights(number, column + 0.5, row + 0.5)
    u, v = np.clip(u, 0, 1), np.clip(v, 0, 1)
    over = np.maximum(u + v, 1)
    return TexelsOnTriangles(
        triangles.size.texel(column, row),
        number.astype(np.int32),
        (u / over).astype(np.float32),
        (v / over).astype(np.float32),
    )
