"""Layers of data and shares as pictures to look at: the numbers 0..1 that an 8-bit file holds, and how to
read the values back from them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F

LEAST = 1 / 255
"""The darkest number of what is seen at any depth; 0 stands for nothing."""


def viewable(
    layer: str, values: NDArray[Any], scale: float, centre: tuple[float, ...]
) -> NDArray[np.float32]:
    """(h, w, 1 or 3) numbers 0..1 that show the layer.

    Normals map -1..1 to 0..1; positions so with `centre` in the middle and `scale` at the rim; depth is
    1 / (1 + depth / scale), near bright, nothing black; uv show their fractions in red and green; every id
    has a colour of its own; shares and errors are what they are.
    """
    if layer in ("normal", "geometric_normal"):
        shown = 0.5 + 0.5 * values
        shown[~values.any(axis=-1)] = 0
    elif layer == "position":
        shown = 0.5 + 0.5 * (values - np.asarray(centre, F)) / F(scale)
        shown[~values.any(axis=-1)] = 0
    elif layer == "depth":
        shown = np.where(values > 0, np.maximum(1 / (1 + values / F(scale)), LEAST), 0)
    elif layer == "uv":
        shown = np.concatenate([values % 1, np.zeros_like(values[..., :1])], axis=-1)
    elif layer.endswith("_id"):
        turn = (values * 0.61803398875) % 1
        hue = (turn + np.array([0, 2 / 3, 1 / 3])) % 1
        shown = np.where(values > 0, np.clip(np.abs(6 * hue - 3) - 1, 0.1, 0.9), 0)
    else:
        shown = values
    return np.clip(shown, 0, 1).astype(F)


def reading(layer: str, scale: float, centre: tuple[float, ...]) -> dict[str, Any]:
    """How to get a layer's values back from the numbers v = byte / 255 of its picture, as metadata."""
    if layer in ("normal", "geometric_normal"):
        return {"illum:values": "normal = 2 v - 1; all 0 where nothing is seen"}
    if layer == "position":
        said = "position = illum:centre + illum:scale * (2 v - 1); all 0 where nothing is seen"
        return {"illum:values": said, "illum:scale": scale, "illum:centre": centre}
    if layer == "depth":
        said = "depth = illum:scale * (1 / v - 1); 0 where nothing is seen"
        return {"illum:values": said, "illum:scale": scale}
    if layer == "uv":
        return {"illum:values": "the fractions of u and v in red and green"}
    if layer.endswith("_id"):
        return {"illum:values": "a colour of its own for every number; an EXR holds the numbers"}
    return {"illum:values": "value = v"}
