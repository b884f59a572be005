"""An order of points that keeps neighbours in space together in memory."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

BLOCK = 4096
MIN_BOX = 8
"""Points in the smallest boxes."""
BITS = 21
"""Bits of a Morton code per axis: 63 for three axes."""


def compact(points: NDArray[np.floating[Any]]) -> NDArray[np.int64]:
    """(N,) indices of the points in compact order.

    Points are ordered along a Morton curve, then each run of `BLOCK` points is halved recursively across the
    longest side of its bounding box. So every aligned run of 8, 16, ... 4096 points fills one box. Rays from
    consecutive points hit the same triangles, and clusters of them are compact, unlike short pieces of a
    Morton curve.

    References
    ----------
    Bentley, J. L. (1975). Multidimensional binary search trees used for associative searching. CACM 18(9).
    """
    count = len(points)
    if not count:
        return np.zeros(0, np.int64)

    # Blocks along the curve; the last one is padded with a distant point.
    size = min(BLOCK, 1 << max(count - 1, 1).bit_length())
    order = np.concatenate([morton_order(points), np.full(-count % size, count)])
    low, high = points.min(axis=0), points.max(axis=0)
    axes = np.vstack([points, high + (high - low)]).T.copy()  # (3, N + 1)

    # Split every box at the median of its longest axis.
    while size > MIN_BOX:
        boxes = order.reshape(-1, size)
        inside = axes.take(boxes, axis=1)
        longest = np.argmax(inside.max(axis=2) - inside.min(axis=2), axis=0)
        along = inside[longest, np.arange(len(boxes))]
        halves = np.argpartition(along, size // 2, axis=1)
        order = np.take_along_axis(boxes, halves, axis=1).ravel()
        size //= 2
    return order[order < count]


def morton_order(points: NDArray[np.floating[Any]]) -> NDArray[np.int64]:
    """(N,) indices of N > 0 points in Morton order (1966)."""
    low = points.min(axis=0)
    size = float(np.max(points.max(axis=0) - low)) or 1.0
    cell = ((np.asarray(points, np.float64) - low) / size * (2**BITS - 1)).astype(np.uint64)
    code = np.zeros(len(points), np.uint64)
    for axis in range(3):
        code |= _spread(cell[:, axis]) << np.uint64(axis)
    return np.argsort(code, kind="stable")


def _spread(x: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The 21 low bits of each number with two zeros between any two."""
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        x = (x | (x << np.uint64(shift))) & np.uint64(mask)
    return x
