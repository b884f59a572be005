"""Layers of data and shares as pictures: numbers 0..1 for an 8-bit file, and the text that describes them.

Each kind of `layers.Preview` has a function to numbers 0..1 and a text with its inverse.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.layers import Layer, Preview

Centre: TypeAlias = tuple[float, ...]

DARKEST = 1 / 255
"""Least number for a surface at any depth; 0 means that there is no surface."""
GOLDEN_RATIO = 0.61803398875
"""Turns of hue from one id to the next: neighbours differ, and no two are equal."""


def viewable(layer: Layer, values: NDArray[Any], scale: float, centre: Centre) -> NDArray[np.float32]:
    """(h, w, 1 or 3) numbers 0..1 that show the layer.

    Parameters
    ----------
    scale : float
        [scene units]: half the range of positions; the depth that has half brightness.
    centre : 3 floats
        Centre of the scene, in the middle of the range of positions.
    """
    show, _ = PREVIEWS[layer.preview]
    if layer.white != 1:
        values = values / F(layer.white)
    return np.clip(show(values, scale, centre), 0, 1).astype(F)


def reading(layer: Layer, scale: float, centre: Centre) -> dict[str, Any]:
    """Metadata that describes how a layer's values follow from the numbers v = byte / 255 of its picture."""
    _, text = PREVIEWS[layer.preview]
    if layer.white != 1:
        text = text.replace("= v", f"= {layer.white:g} v")
    metadata: dict[str, Any] = {"illum:values": text}
    if "illum:scale" in text:
        metadata["illum:scale"] = scale
    if "illum:centre" in text:
        metadata["illum:centre"] = centre
    return metadata


def _value(values: NDArray[Any], scale: float, centre: Centre) -> NDArray[Any]:
    return values


def _direction(values: NDArray[Any], scale: float, centre: Centre) -> NDArray[Any]:
    shown = 0.5 + 0.5 * values
    shown[~values.any(axis=-1)] = 0
    return shown


def _position(values: NDArray[Any], scale: float, centre: Centre) -> NDArray[Any]:
    shown = 0.5 + 0.5 * (values - np.asarray(centre, F)) / F(scale)
    shown[~values.any(axis=-1)] = 0
    return shown


def _depth(values: NDArray[Any], scale: float, centre: Centre) -> NDArray[Any]:
    """Near surfaces are bright; no surface is black."""
    return np.where(values > 0, np.maximum(1 / (1 + values / F(scale)), DARKEST), 0)


def _fraction(values: NDArray[Any], scale: float, centre: Centre) -> NDArray[Any]:
    return np.concatenate([values % 1, np.zeros_like(values[..., :1])], axis=-1)


def _number(values: NDArray[Any], scale: float, centre: Centre) -> NDArray[Any]:
    turn = (values * GOLDEN_RATIO) % 1
    hue = (turn + np.array([0, 2 / 3, 1 / 3])) % 1
    return np.where(values > 0, np.clip(np.abs(6 * hue - 3) - 1, 0.1, 0.9), 0)


Show: TypeAlias = Callable[[NDArray[Any], float, Centre], NDArray[Any]]
PREVIEWS: dict[Preview, tuple[Show, str]] = {
    "value": (_value, "value = v"),
    "direction": (_direction, "normal = 2 v - 1; all 0 where nothing is seen"),
    "position": (
        _position,
        "position = illum:centre + illum:scale * (2 v - 1); all 0 where nothing is seen",
    ),
    "depth": (_depth, "depth = illum:scale * (1 / v - 1); 0 where nothing is seen"),
    "fraction": (_fraction, "the fractions of u and v in red and green"),
    "number": (_number, "a colour of its own for every number; an EXR holds the numbers"),
}
"""Kind of preview -> the function to numbers 0..1, and the text that describes them."""
