"""Connected components of a graph, by array operations."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def components(
    first: NDArray[np.integer[Any]], second: NDArray[np.integer[Any]], count: int
) -> NDArray[np.integer[Any]]:
    """(count,) the lowest node that each of `count` nodes is connected to.

    If an edge joins two roots, the larger becomes a child of the smaller, then the trees are flattened. This
    is repeated until no edge joins two roots.

    Parameters
    ----------
    first, second : (E,) int
        Nodes that each edge joins.
    """
    root = np.arange(count, dtype=first.dtype)
    while first.size:
        one, other = root.take(first), root.take(second)
        low, high = np.minimum(one, other), np.maximum(one, other)
        is_joining = low != high
        np.minimum.at(root, high[is_joining], low[is_joining])
        first, second = first[is_joining], second[is_joining]
        while not np.array_equal(flatter := root.take(root), root):
            root = flatter
    return root
