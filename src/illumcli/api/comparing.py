"""Compare pictures: files, arrays, or what `render` returned."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.api.pictures import Picture, Rendering
from illumcli.errors import InputError
from illumcli.images.comparison import layer_differences, refuse_unlike, shared_layers
from illumcli.images.reader import Image, read_image

AnyImage: TypeAlias = "str | os.PathLike[str] | NDArray[Any] | Picture | Rendering"
"""An image file, an array (H, W) or (H, W, C) of linear light, or rendered pictures."""
NAMES = {1: ("Y",), 3: ("R", "G", "B"), 4: ("R", "G", "B", "A")}


def compare(
    reference: AnyImage, test: AnyImage, layers: Sequence[str] = (), *, flip: bool = True
) -> dict[str, dict[str, Any]]:
    """How two pictures differ, by layer: the measures of ``illum compare --json``.

    Parameters
    ----------
    layers : sequence of str
        By default all that both have.
    flip : bool
        Measure FLIP, too, of layers with colours; it takes far longer.

    Raises
    ------
    InputError
        A file cannot be read; sizes or kinds differ; no layer in common.
    """
    a, b = _image(reference), _image(test)
    names = _name(reference, "reference"), _name(test, "test")
    refuse_unlike(a, b, *names)
    shared = shared_layers(a, b, layers, " and ".join(names))
    return {each.name: each.as_data() for each in layer_differences(a, b, shared, flip)}


def _image(given: AnyImage) -> Image:
    if isinstance(given, Rendering):
        given = given.picture
    if isinstance(given, Picture):
        channels = {
            name: layer[..., number]
            for key, layer in given.items()
            for number, name in enumerate(given.channels[key])
        }
        height, width = next(iter(channels.values())).shape
        return Image(width, height, channels, encoded=False, metadata=given.metadata)
    if isinstance(given, str | os.PathLike):
        return read_image(Path(given))
    array = np.asarray(given, np.float32)
    array = array[..., None] if array.ndim == 2 else array
    if array.ndim != 3 or array.shape[2] not in NAMES:
        raise InputError(f"an array of {array.shape} is no picture; give (H, W) or (H, W, 1, 3 or 4)")
    planes = dict(zip(NAMES[array.shape[2]], np.moveaxis(array, -1, 0), strict=True))
    return Image(array.shape[1], array.shape[0], planes, encoded=False, metadata={})


def _name(given: AnyImage, otherwise: str) -> str:
    return os.fspath(given) if isinstance(given, str | os.PathLike) else otherwise
