"""Pixel reconstruction: the mean of a pixel's samples for light, the sample nearest its centre for data."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Ids


def pixel_means(values: NDArray[np.float32], sample: Ids, pixels: int, samples: int) -> NDArray[np.float32]:
    """(P, k) float32 mean over each pixel's samples; samples that miss count as 0.

    The sums are in float64 and over one pixel's samples in their order, so that they do not depend on tiles.

    Parameters
    ----------
    values : (M,) or (M, k) float32
        At the hits.
    sample : (M,) int32
        Indices of the hits' samples.
    pixels, samples : int
        Number of pixels, and of samples per pixel.
    """
    # Fill in the samples that miss.
    values = values if values.ndim == 2 else values[:, None]
    planes = np.asarray(values.T, F)
    if len(sample) < pixels * samples:
        planes = np.zeros((values.shape[1], pixels * samples), F)
        where = sample.astype(np.intp)
        for plane, at_hits in zip(planes, values.T, strict=True):
            plane[where] = at_hits

    # Average.
    if samples == 1:
        return planes.T
    by_pixel = planes.reshape(len(planes), pixels, samples)
    return by_pixel.mean(axis=2, dtype=np.float64).T.astype(F)


def pixel_nearest(values: NDArray[Any], sample: Ids, nearest: Ids, pixels: int) -> NDArray[Any]:
    """(P, k) value of the sample nearest to each pixel's centre, in the values' dtype; 0 if that misses.

    Parameters
    ----------
    values : (M,) or (M, k)
        At the hits.
    sample : (M,) int32
        Indices of the hits' samples.
    nearest : (P,) int32
        Index of the sample nearest to each pixel's centre.
    """
    values = values if values.ndim == 2 else values[:, None]
    row = np.full(
        int(nearest.max(initial=-1)) + 1
        if not sample.size
        else max(int(nearest.max()), int(sample.max())) + 1,
        -1,
    )
    row[sample] = np.arange(len(sample))
    which = row[nearest]
    out = np.zeros((pixels, values.shape[1]), values.dtype)
    out[which >= 0] = values[which[which >= 0]]
    return out
