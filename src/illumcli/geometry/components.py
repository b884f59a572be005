"""Connected components of a graph, by arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def components(first: NDArray[Any], second: NDArray[Any], count: int) -> NDArray[np.int64]:
    """(count,) the lowest node that each node is connected to, by edges between `first` and `second`, (E,).

    The larger of two roots that an edge joins is hooked below the smaller, then the trees are flattened,
    until no edge joins two roots.
    """
    root = np.arange(count)
    while first.size:
        low, high = np.sort([root.take(first), root.take(second)], axis=0)
        apart = low != high
        np.minimum.at(root, high[apart], low[apart])
        first, second = first[apart], second[apart]
        while not np.array_equal(flatter := root.take(root), root):
            root = flatter
    return root
