"""Layers of data as pictures to look at: what an 8-bit file shows of normals, depths, positions and ids."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.pixels import from_srgb


def viewable(
    layer: str, values: NDArray[np.float32], scale: float, centre: tuple[float, ...]
) -> NDArray[np.float32]:
    """(h, W, 1 or 3) light whose sRGB encoding shows the layer; layers of light are left as they are.

    Normals map -1..1 to 0..1; positions so with `centre` in the middle and `scale` at the rim; depth is
    1 / (1 + depth / scale), near bright, nothing black; uv show their fractions in red and green; every id
    has a colour of its own.
    """
    if layer in ("normal", "geometric_normal"):
        shown = 0.5 + 0.5 * values
        shown[~values.any(axis=-1)] = 0
    elif layer == "position":
        shown = 0.5 + 0.5 * (values - np.asarray(centre, F)) / F(scale)
        shown[~values.any(axis=-1)] = 0
    elif layer == "depth":
        shown = np.where(values > 0, 1 / (1 + values / F(scale)), 0)
    elif layer == "uv":
        shown = np.concatenate([values % 1, np.zeros_like(values[..., :1])], axis=-1)
    elif layer.endswith("_id"):
        turn = (values * F(0.61803399)) % 1
        hue = (turn + np.array([0, 2 / 3, 1 / 3], F)) % 1
        shown = np.where(values > 0, np.clip(np.abs(6 * hue - 3) - 1, 0.1, 0.9), 0)
    else:
        return values
    return from_srgb(np.clip(shown, 0, 1)).astype(F)
