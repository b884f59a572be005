"""Fills the gutters of textures, so that neither bilinear lookups nor mipmaps mix in a background.

References
----------
Gortler, S. J. et al. (1996). The lumigraph. SIGGRAPH '96, section 3.4.3 (pull-push).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F


def filled(values: NDArray[np.float32], is_known: NDArray[np.bool_]) -> NDArray[np.float32]:
    """(H, W) the values where they are known, elsewhere means of those nearby; 1 if none are known.

    Each level of a pyramid holds the means of two by two texels of the level below that are known; an unknown
    texel takes the value of the finest level that knows one.
    """
    if is_known.all():
        return values
    if not is_known.any():
        return np.ones_like(values)
    coarse = filled(*_halved(values, is_known))
    rows, columns = (np.arange(count) // 2 for count in values.shape)
    return np.where(is_known, values, coarse[np.ix_(rows, columns)])


def _halved(
    values: NDArray[np.float32], is_known: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Means of the known among two by two texels, and where there is one.

    An odd last row or column is alone.
    """
    rows, columns = (range(0, count, 2) for count in values.shape)
    known = np.where(is_known, values, F(0))
    total = np.add.reduceat(np.add.reduceat(known, rows, axis=0), columns, axis=1)
    count = np.add.reduceat(np.add.reduceat(is_known.astype(F), rows, axis=0), columns, axis=1)
    return (total / np.maximum(count, F(1))).astype(F), count > 0
