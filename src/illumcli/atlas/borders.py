"""Texels along the borders of charts: their centres are outside, but lookups on the surface read them.

A bilinear lookup reads the four texels whose centres are less than one texel away in each direction. So
lookups on a chart read the texels whose centres it covers and those within one texel of its border.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from illumcli.atlas.centres import blocks, runs
from illumcli.atlas.triangles import STEPS, AtlasTriangles
from illumcli.records import Record


class BorderTexels(Record):
    """K texels whose centres no triangle covers, each with the nearest place on the border of a chart."""

    texel: NDArray[np.int32]  # (K,) ascending
    number: NDArray[np.int32]  # (K,) of the triangle among the `AtlasTriangles`
    edge: NDArray[np.int8]  # (K,) from corner `edge` to the next one
    along: NDArray[np.float32]  # (K,) where on the edge: 0 at its first corner, 1 at the next
    x: NDArray[np.float64]  # (K,) the centre, in the tile of the triangle [texels]
    y: NDArray[np.float64]  # (K,)


def border_texels(triangles: AtlasTriangles, is_covered: NDArray[np.bool_]) -> BorderTexels:
    """The texels along all borders.

    Parameters
    ----------
    is_covered : (texels,) bool
        True where a triangle covers the centre.
    """
    number, edge = border_edges(triangles)
    following = (edge + 1) % 3
    ends = np.stack([axis[k, number] for k in (edge, following) for axis in (triangles.x, triangles.y)])
    kept = []
    for which, column, row in _around(ends):
        texel = triangles.size.texel(column, row)
        outside = np.flatnonzero(~is_covered[texel])
        centre = np.stack([column[outside], row[outside]]).astype(np.float64) + 0.5
        along, square = _nearest(ends[:, which[outside]], centre)
        kept.append(np.stack([texel[outside], which[outside], along, square, *centre]))

    # of each texel the nearest place
    texel, at, along, square, x, y = np.concatenate([np.zeros((6, 0)), *kept], axis=1)
    order = np.lexsort((at, square, texel))
    best = order[np.diff(texel[order], prepend=-1) > 0]
    at = at[best].astype(np.int64)
    return BorderTexels(
        texel[best].astype(np.int32),
        number[at].astype(np.int32),
        edge[at].astype(np.int8),
        along[best].astype(np.float32),
        x[best],
        y[best],
    )


def border_edges(triangles: AtlasTriangles) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The triangle, and its corner where the edge begins, of all edges with triangles on one side only."""
    # every edge from its end that comes first, in whole steps; the side of the triangle's third corner
    steps = [np.rint(axis * STEPS).astype(np.int64) for axis in (triangles.x, triangles.y)]
    from_x, from_y, to_x, to_y = (np.roll(axis, -turn, axis=0).ravel() for turn in (0, 1) for axis in steps)
    turned = (to_y < from_y) | ((to_y == from_y) & (to_x < from_x))
    from_x, to_x = np.where(turned, to_x, from_x), np.where(turned, from_x, to_x)
    from_y, to_y = np.where(turned, to_y, from_y), np.where(turned, from_y, to_y)
    side = np.tile(triangles.is_mirrored, 3) ^ turned

    # equal edges follow each other; tiles of the repeated texture are one
    wide, high = triangles.size.width * STEPS, triangles.size.height * STEPS
    first = (from_y % high << 32) + from_x % wide
    across = (to_y - from_y << 32) + (to_x - from_x)
    order = np.lexsort((across, first))
    begins = np.flatnonzero(
        (np.diff(first[order], prepend=-1) != 0) | (np.diff(across[order], prepend=0) != 0)
    )
    if not begins.size:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    one_sided = np.logical_and.reduceat(side[order], begins) | ~np.logical_or.reduceat(side[order], begins)
    count = np.diff(np.append(begins, len(order)))
    border = np.sort(order[np.repeat(one_sided, count)])
    return border % len(triangles.triangle), border // len(triangles.triangle)


def _around(
    ends: NDArray[np.float64],
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]]:
    """Texels whose centres are less than one texel from a point of an edge in x and y: number of the edge,
    column, row."""
    ax, ay, bx, by = ends
    low, high = np.minimum(ay, by), np.maximum(ay, by)
    first = np.floor(low - 1.5).astype(np.int64) + 1
    count = np.ceil(high + 0.5).astype(np.int64) - first
    slope = np.divide(bx - ax, by - ay, out=np.zeros_like(ax), where=by != ay)
    for block in blocks(count):
        row, run = runs(first[block], count[block])
        which = run + block.start

        # the part of the edge within one texel of the row of centres
        begin = np.maximum(low[which], row - 0.5)
        end = np.minimum(high[which], row + 1.5)
        level = ay[which] == by[which]
        x0 = np.where(level, ax[which], ax[which] + (begin - ay[which]) * slope[which])
        x1 = np.where(level, bx[which], ax[which] + (end - ay[which]) * slope[which])
        left = np.floor(np.minimum(x0, x1) - 1.5).astype(np.int64) + 1
        width = np.maximum(np.ceil(np.maximum(x0, x1) + 0.5).astype(np.int64) - left, 0)
        for piece in blocks(width):
            column, of = runs(left[piece], width[piece])
            yield which[piece][of], column, row[piece][of]


def _nearest(
    ends: NDArray[np.float64], centre: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(K,) where on an edge the place nearest to a centre is, in [0, 1], and the squared distance."""
    ax, ay, bx, by = ends
    x, y = centre
    dx, dy = bx - ax, by - ay
    along = np.clip(((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy), 0, 1)
    return along, np.square(ax + along * dx - x) + np.square(ay + along * dy - y)
