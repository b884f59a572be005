"""Adaptive antialiasing: pixels whose samples, or whose neighbours' samples, differ get all samples.

A pixel that is not refined keeps its first few samples. Features smaller than the sample spacing, and noise
that happens to be equal in all of them, are missed. Adaptive images are therefore biased towards smoothness;
refined pixels are the same as without it.

References
----------
Whitted, T. (1980). An improved illumination model for shaded display. CACM 23(6): more samples where the
corners of a pixel differ.
Kirk, D. and Arvo, J. (1991). Unbiased sampling techniques for image synthesis. SIGGRAPH '91: why keeping the
samples that decided is biased.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Ids

NORMAL_DIFFERENCE = 0.3
"""Greatest difference between components of unit normals that count as equal: about 17 degrees."""
DARK = 0.05
"""Least radiance that differences are relative to."""


def differs_in_shape(
    objects: NDArray[np.uint32],
    normals: NDArray[np.float32],
    sample: Ids,
    shape: tuple[int, int],
    samples: int,
) -> NDArray[np.bool_]:
    """(h, w) True where the samples in and around a pixel hit different objects, or faces at an angle.

    A step in depth between parallel faces of one object is left to `differs_in_light`.

    Parameters
    ----------
    objects : (M,) uint32
    normals : (M, 3) float32
        At the hits; samples that miss count as 0.
    sample : (M,) int32
        Indices of the hits' samples.
    shape : (int, int)
        Rows and columns of pixels, each with `samples` samples.
    """
    low, high = extremes(np.column_stack([objects, normals]), sample, shape, samples)
    other_object = low[..., 0] != high[..., 0]
    other_normal = (high[..., 1:] - low[..., 1:] > NORMAL_DIFFERENCE).any(axis=2)
    return np.asarray(other_object | other_normal)


def differs_in_light(
    values: NDArray[np.float32], sample: Ids, shape: tuple[int, int], samples: int, difference: float
) -> NDArray[np.bool_]:
    """(h, w) True where the samples in and around a pixel differ in a channel by more than `difference` times
    the brightest channel.

    Parameters
    ----------
    values : (M,) or (M, k) float32
        At the hits; samples that miss count as 0.
    """
    low, high = extremes(values if values.ndim == 2 else values[:, None], sample, shape, samples)
    scale = np.maximum(high.max(axis=2), F(DARK))
    return np.asarray((high - low).max(axis=2) > F(difference) * scale)


def extremes(
    values: NDArray[np.float32], sample: Ids, shape: tuple[int, int], samples: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(h, w, k) least and greatest value among the samples of each pixel and its eight neighbours."""
    height, width = shape
    planes = np.zeros((values.shape[1], height * width * samples), F)
    planes[:, sample] = values.T
    by_pixel = planes.reshape(len(planes), height, width, samples)
    low, high = by_pixel.min(axis=3), by_pixel.max(axis=3)
    for axis in (1, 2):
        low, high = _of_three(low, np.minimum, axis), _of_three(high, np.maximum, axis)
    return low.transpose(1, 2, 0), high.transpose(1, 2, 0)


def _of_three(values: NDArray[np.float32], extreme: np.ufunc, axis: int) -> NDArray[np.float32]:
    """`extreme`, the minimum or maximum, of each value and its two neighbours along an axis."""
    moved = np.moveaxis(values, axis, 0)
    out = moved.copy()
    extreme(out[1:], moved[:-1], out=out[1:])
    extreme(out[:-1], moved[1:], out=out[:-1])
    return np.moveaxis(out, 0, axis)
