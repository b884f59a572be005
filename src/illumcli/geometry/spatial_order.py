"""An order of points in which those that stand together lie together."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

BLOCK = 4096
SMALLEST = 8
BITS = 21  # per axis, three of which fill 63


def compact(points: NDArray[np.floating[Any]]) -> NDArray[np.int64]:
    """(N,) the points' numbers: along a Morton curve, every 4096 in a row halved again and again across the
    longest side of their box.

    So every 8, 16, ... 4096 in a row from the start are the points of one box. Rays of points in a row meet
    the same triangles, and clusters of them are compact, which short stretches of a Morton curve are not.

    References
    ----------
    Bentley, J. L. (1975). Multidimensional binary search trees used for associative searching. CACM 18(9).
    """
    count = len(points)
    if not count:
        return np.zeros(0, np.int64)
    size = min(BLOCK, 1 << max(count - 1, 1).bit_length())
    padded = np.concatenate([along_curve(points), np.full(-count % size, count)])
    low, high = points.min(axis=0), points.max(axis=0)
    axes = np.vstack([points, high + (high - low)]).T.copy()  # (3, N + 1), the last one far out
    while size > SMALLEST:
        boxes = padded.reshape(-1, size)
        own = axes.take(boxes, axis=1)
        longest = np.argmax(own.max(axis=2) - own.min(axis=2), axis=0)
        along = own[longest, np.arange(len(boxes))]
        halves = np.argpartition(along, size // 2, axis=1)
        padded = np.take_along_axis(boxes, halves, axis=1).ravel()
        size //= 2
    return padded[padded < count]


def along_curve(points: NDArray[np.floating[Any]]) -> NDArray[np.int64]:
    """(N,) the numbers of N > 0 points in Morton order (1966)."""
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
