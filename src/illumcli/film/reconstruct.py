"""Samples to pixels: what a layer is made of and how its samples become one value."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Ids


def pixel_means(values: NDArray[np.float32], lane: Ids, pixels: int, samples: int) -> NDArray[np.float32]:
    """(P, k) mean over each pixel's samples of (M, k) values at the samples seen, 0 elsewhere.

    Summed in float64; a pixel's samples always stand together, so that tiles change nothing.
    """
    values = values if values.ndim == 2 else values[:, None]
    planes = np.asarray(values.T, F)
    if len(lane) < pixels * samples:
        planes = np.zeros((values.shape[1], pixels * samples), F)
        where = lane.astype(np.intp)
        for plane, seen in zip(planes, values.T, strict=True):
            plane[where] = seen
    if samples == 1:
        return planes.T
    by_pixel = planes.reshape(len(planes), pixels, samples)
    return by_pixel.mean(axis=2, dtype=np.float64).T.astype(F)


def pixel_nearest(values: NDArray[Any], lane: Ids, nearest: Ids, pixels: int) -> NDArray[Any]:
    """(P, k) of the sample nearest to each pixel's centre, in the values' type, 0 where it sees nothing.

    Parameters
    ----------
    nearest : (P,) int32
        That sample's lane in the tile.
    """
    values = values if values.ndim == 2 else values[:, None]
    row = np.full(
        int(nearest.max(initial=-1)) + 1 if not lane.size else max(int(nearest.max()), int(lane.max())) + 1,
        -1,
    )
    row[lane] = np.arange(len(lane))
    which = row[nearest]
    out = np.zeros((pixels, values.shape[1]), values.dtype)
    out[which >= 0] = values[which[which >= 0]]
    return out
