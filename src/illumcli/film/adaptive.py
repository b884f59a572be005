"""Adaptive antialiasing: pixels whose samples, or whose neighbours' samples, differ get all samples.

A pixel that is not refined keeps its first few samples. Features smaller than the sample spacing, and noise
that happened to agree, are missed. So adaptive pictures are biased, towards smoothness; refined pixels are
the same as without it.

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

TURN = 0.3
"""Components of unit normals that lie farther apart differ: directions 17 degrees apart or more."""
DARK = 0.05
"""Light below this counts as this much when differences are weighed."""


def differs_in_shape(
    objects: NDArray[np.uint32],
    normals: NDArray[np.float32],
    lane: Ids,
    shape: tuple[int, int],
    samples: int,
) -> NDArray[np.bool_]:
    """(h, w) True where samples around see different objects or faces turned apart.

    A leap in depth between faces of one object that lie alike shows in its light or nowhere.

    Parameters
    ----------
    objects : (M,) uint32
    normals : (M, 3) float32
        Of the samples that see something; 0 stands for the others.
    lane : (M,) int32
        Those samples.
    shape : (int, int)
        Rows and columns of the pixels, `samples` each.
    """
    low, high = extremes(np.column_stack([objects, normals]), lane, shape, samples)
    other = low[..., 0] != high[..., 0]
    turned = (high[..., 1:] - low[..., 1:] > TURN).any(axis=2)
    return np.asarray(other | turned)


def differs_in_light(
    values: NDArray[np.float32], lane: Ids, shape: tuple[int, int], samples: int, difference: float
) -> NDArray[np.bool_]:
    """(h, w) True where samples around differ in a channel by more than a share of the brightest channel.

    Parameters
    ----------
    values : (M,) or (M, k) float32
        Of the samples that see something; 0 stands for the others.
    """
    low, high = extremes(values if values.ndim == 2 else values[:, None], lane, shape, samples)
    scale = np.maximum(high.max(axis=2), F(DARK))
    return np.asarray((high - low).max(axis=2) > F(difference) * scale)


def extremes(
    values: NDArray[np.float32], lane: Ids, shape: tuple[int, int], samples: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(h, w, k) least and greatest value of the samples of each pixel and its eight neighbours."""
    height, width = shape
    planes = np.zeros((values.shape[1], height * width * samples), F)
    planes[:, lane] = values.T
    by_pixel = planes.reshape(len(planes), height, width, samples)
    low, high = by_pixel.min(axis=3), by_pixel.max(axis=3)
    for axis in (1, 2):
        low, high = _of_three(low, np.minimum, axis), _of_three(high, np.maximum, axis)
    return low.transpose(1, 2, 0), high.transpose(1, 2, 0)


def _of_three(values: NDArray[np.float32], least: np.ufunc, axis: int) -> NDArray[np.float32]:
    """The least (or greatest) of each value and those beside it along an axis."""
    moved = np.moveaxis(values, axis, 0)
    out = moved.copy()
    least(out[1:], moved[:-1], out=out[1:])
    least(out[:-1], moved[1:], out=out[:-1])
    return np.moveaxis(out, 0, axis)
