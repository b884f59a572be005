"""Differences between two images, layer by layer."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.film.channels import group_by_layer
from illumcli.film.heat import heat
from illumcli.film.metrics import Difference, absolute_difference, difference
from illumcli.images.flip import flip
from illumcli.images.reader import Image, read_image
from illumcli.records import Value
from illumcli.schema.messages import suggestion


class LayerDifference(Value):
    """How one layer of two images differs."""

    name: str
    channels: tuple[str, ...]
    difference: Difference
    flip: float | None  # mean FLIP error; None unless it has R, G and B, all finite, and FLIP was requested

    @property
    def place(self) -> tuple[int, int, str]:
        """x, y and channel of the largest difference; x and y count from the upper left pixel 0, 0."""
        row, column, channel = self.difference.place
        return column, row, self.channels[channel]

    @property
    def has_colors(self) -> bool:
        """True if it has R, G and B."""
        return bool(color_channels(self.channels))

    @property
    def heat_scale(self) -> float:
        """The difference that is brightest in a heat image."""
        return self.difference.largest or 1.0

    def as_data(self) -> dict[str, Any]:
        """The difference for JSON; infinite values and NaN are null."""
        return {
            "layer": self.name,
            "channels": list(self.channels),
            "rmse": _finite(self.difference.rmse),
            "relative_mse": _finite(self.difference.relative_mse),
            "mae": _finite(self.difference.mae),
            "psnr": _finite(self.difference.psnr),
            "flip": self.flip,
            "largest": self.difference.largest,
            "at": dict(zip(("x", "y", "channel"), self.place, strict=True)),
            "not_finite": self.difference.not_finite,
        }


def read_pair(reference: Path, test: Path) -> tuple[Image, Image]:
    """Two images that can be compared.

    Raises
    ------
    InputError
        Files cannot be read, both are named then; images differ in size or kind.
    """
    images: list[Image] = []
    problems: list[str] = []
    for path in (reference, test):
        try:
            images.append(read_image(path))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    a, b = images
    refuse_unlike(a, b, str(reference), str(test))
    return a, b


def refuse_unlike(a: Image, b: Image, reference: str, test: str) -> None:
    """Raise InputError if images differ in size or kind; the texts name them."""
    if (a.width, a.height) != (b.width, b.height):
        sizes = f"{b.width} x {b.height}, but {reference} is {a.width} x {a.height}"
        raise InputError(f"{test}: is {sizes}; compare images of one size")
    if a.encoded != b.encoded:
        kinds = "linear light", "display values"
        fact = f"holds {kinds[b.encoded]}, but {reference} {kinds[a.encoded]}"
        raise InputError(f"{test}: {fact}; compare two files of a kind")


def shared_layers(a: Image, b: Image, names: Iterable[str], place: str) -> dict[str, tuple[str, ...]]:
    """Layer -> channels that both images have; the layers of `names`, in that order, or all.

    Raises
    ------
    InputError
        No common channel, or an unknown layer; `place` names the images.
    """
    shared = group_by_layer(name for name in a.channels if name in b.channels)
    if not shared:
        raise InputError(f"{place}: no channel in common; render the same layers into both")
    known = tuple(shared)
    unknown = [
        f"{place}: no layer '{name}' in both; {suggestion(name, known)}"
        for name in names
        if name not in shared
    ]
    if unknown:
        raise InputError(unknown)
    return {name: shared[name] for name in names or known}


def layer_differences(
    reference: Image, test: Image, layers: Mapping[str, tuple[str, ...]], flips: bool
) -> tuple[LayerDifference, ...]:
    """How each layer differs; `flips` says whether FLIP is computed for layers with R, G and B."""
    differences = []
    for name, channels in layers.items():
        measures = difference(
            stacked(reference, channels), stacked(test, channels), peak=1.0 if reference.encoded else None
        )
        colors = color_channels(channels)
        error = None
        if flips and colors:
            error = _flip(stacked(reference, colors), stacked(test, colors), reference.encoded)
        differences.append(LayerDifference(name, channels, measures, error))
    return tuple(differences)


def color_channels(channels: Sequence[str]) -> list[str]:
    """The channels R, G and B of a layer; empty unless it has all three."""
    colors = [channel for channel in channels if channel.rpartition(".")[2] in tuple("RGB")]
    return colors if len(colors) == 3 else []


def stacked(image: Image, channels: Sequence[str]) -> NDArray[np.float32]:
    """(H, W, C) the values of some channels."""
    return np.stack([image.channels[channel] for channel in channels], axis=-1)


def heat_picture(reference: Image, test: Image, layer: LayerDifference) -> NDArray[np.uint8]:
    """(H, W, 3) sRGB: where a layer differs, by the channel that differs most, brightest at `heat_scale`."""
    values = (stacked(each, layer.channels) for each in (reference, test))
    return heat(absolute_difference(*values).max(axis=-1), layer.heat_scale)


def _flip(reference: NDArray[np.float32], test: NDArray[np.float32], encoded: bool) -> float | None:
    """Mean FLIP error; None if a value is not finite."""
    if np.array_equal(reference, test):
        return 0.0
    if not (np.isfinite(reference).all() and np.isfinite(test).all()):
        return None
    return flip(reference, test, encoded)[0]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
