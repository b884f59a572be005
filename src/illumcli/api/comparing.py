"""Compare pictures: files, arrays, or what `render` returned."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.api.html_tables import html_table
from illumcli.api.pictures import Picture, Rendering
from illumcli.errors import InputError
from illumcli.images.comparison import (
    LayerDifference,
    color_channels,
    heat_picture,
    layer_differences,
    refuse_unlike,
    shared_layers,
    stacked,
)
from illumcli.images.reader import Image, read_image
from illumcli.schema.messages import suggestion

AnyImage: TypeAlias = "str | os.PathLike[str] | NDArray[Any] | Picture | Rendering"
"""An image file, an array (H, W) or (H, W, C), of floats that are linear light or of uint8 that are display
values, or rendered pictures."""
NAMES = {1: ("Y",), 3: ("R", "G", "B"), 4: ("R", "G", "B", "A")}


class Comparison(dict[str, dict[str, Any]]):
    """Layer -> its measures; a notebook shows a table."""

    def __init__(self, reference: Image, test: Image, differences: Sequence[LayerDifference]) -> None:
        super().__init__({each.name: each.as_data() for each in differences})
        self._images = reference, test
        self._differences = {each.name: each for each in differences}

    def heat(self, layer: str | None = None) -> NDArray[np.uint8]:
        """(H, W, 3) sRGB, the picture of ``--heat``: where a layer differs, by default the first."""
        return heat_picture(*self._images, self._difference(layer))

    def flip_map(self, layer: str | None = None) -> NDArray[np.float32]:
        """(H, W) FLIP of a layer with colours, 0 where an observer sees no difference, up to 1.

        Raises
        ------
        InputError
            It has no colours.
        """
        chosen, (a, b) = self._difference(layer), self._images
        colors = color_channels(chosen.channels)
        if not colors:
            raise InputError(f"layer '{chosen.name}' has no colours, which FLIP needs; see its heat picture")
        from illumcli.images.flip import flip

        return flip(stacked(a, colors), stacked(b, colors), a.encoded)[1]

    def _difference(self, layer: str | None) -> LayerDifference:
        chosen = next(iter(self)) if layer is None else layer
        if chosen not in self:
            raise KeyError(f"no layer {chosen!r}; {suggestion(chosen, tuple(self))}")
        return self._differences[chosen]

    def _repr_html_(self) -> str:
        left_out = ("channels", "at", "not_finite")
        rows = [{name: each[name] for name in each if name not in left_out} for each in self.values()]
        return html_table(rows)


def compare(
    reference: AnyImage, test: AnyImage, layers: Sequence[str] | str = (), *, flip: bool = True
) -> Comparison:
    """How two pictures differ, by layer: the measures of ``illum compare --json``.

    Parameters
    ----------
    reference, test : path-like, array, Picture or Rendering
        Arrays are (H, W) or (H, W, C), floats of linear light or uint8 of display values. Of a rendering, its
        first picture.
    layers : sequence of str or str
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
    chosen = (layers,) if isinstance(layers, str) else layers
    shared = shared_layers(a, b, chosen, " and ".join(names))
    return Comparison(a, b, layer_differences(a, b, shared, flip))


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
    array = np.asarray(given)
    is_encoded = array.dtype == np.uint8
    if not (is_encoded or array.dtype.kind in "fb"):
        kinds = "a file, a rendering, floats of linear light or uint8 of display values"
        raise InputError(f"a picture must be {kinds}, is {array.dtype}")
    array = array.astype(np.float32) / (255 if is_encoded else 1)
    array = array[..., None] if array.ndim == 2 else array
    if array.ndim != 3 or array.shape[2] not in NAMES:
        raise InputError(f"an array of {array.shape} is no picture; give (H, W) or (H, W, 1, 3 or 4)")
    planes = dict(zip(NAMES[array.shape[2]], np.moveaxis(array, -1, 0), strict=True))
    return Image(array.shape[1], array.shape[0], planes, encoded=is_encoded, metadata={})


def _name(given: AnyImage, otherwise: str) -> str:
    return os.fspath(given) if isinstance(given, str | os.PathLike) else otherwise
