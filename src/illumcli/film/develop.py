"""Develops the layers of a view into the pixels of its image files."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from illumcli.film.channels import ChannelType, bits_of, channel_types
from illumcli.film.encode import picture, plain
from illumcli.film.preview import reading, viewable
from illumcli.film.tiles import Tile
from illumcli.film.view import View
from illumcli.layers import Layer
from illumcli.records import Value
from illumcli.render_space import RenderSpace


class Target(Value):
    """One file of an image set and the layers it holds."""

    path: Path
    view: View
    layers: tuple[Layer, ...]
    content: str
    """Hash of everything that its pixels depend on."""
    rows: tuple[int, int] | None = None
    """The rows of the picture that it holds, from the first to before the second; by default all."""
    picture: str = ""
    """The content of the whole picture, if it holds some rows."""

    @property
    def height(self) -> int:
        """Number of its rows."""
        first, end = self.rows or (0, self.view.height)
        return end - first

    @property
    def is_png(self) -> bool:
        """True if it holds one layer in 8 bits; otherwise it holds the values of all layers."""
        return self.path.suffix.lower() == ".png"


class Development(Value):
    """How the layers of a scene become pixels of files."""

    background: tuple[float, float, float] | None
    """Colour behind the surfaces; None leaves them with an alpha channel."""
    exposure: float
    """Exposure of pictures in 8 bits [stops]."""
    colour: Literal["half", "float"]
    """Type of light in EXR files."""

    def channels(self, target: Target) -> dict[str, ChannelType]:
        """Channel name -> type of a file; the beauty's R G B A come first."""
        if target.is_png:
            layer = target.layers[0]
            names = ("Y",) if len(layer.channels) == 1 and layer.kind != "id" else tuple("RGB")
            return dict.fromkeys((*names, "A") if self._has_alpha(layer) else names, "uint8")
        shown = [name for layer in _beauty_first(target.layers) for name in self.names(layer)]
        types = dict(channel_types(tuple(dict.fromkeys(shown)), self.colour))
        ids = (name for layer in target.layers if layer.kind == "id" for name in layer.channels)
        return types | dict.fromkeys(ids, "uint")

    def pixels(
        self, target: Target, tile: Tile, layers: Mapping[str, NDArray[Any]], space: RenderSpace
    ) -> NDArray[Any]:
        """(rows, columns, channels) of one file's tile, for its writer.

        Parameters
        ----------
        layers : mapping
            Layer -> (rows, columns, channels).
        """
        composed = {layer.name: self.composed(layer, layers) for layer in target.layers}
        return self.encoded(target, composed, (tile.y, tile.x), space)

    def encoded(
        self,
        target: Target,
        composed: Mapping[str, NDArray[Any]],
        corner: tuple[int, int],
        space: RenderSpace,
    ) -> NDArray[Any]:
        """(rows, columns, channels) of composed layers, as the file holds them; `corner` is the first row and
        column."""
        # One layer in 8 bits: light with its exposure, data as a preview.
        if target.is_png:
            layer = target.layers[0]
            values = composed[layer.name]
            if layer.kind == "light":
                return picture(values, self.exposure, 8, str(target.path), *corner)
            shown = viewable(layer, values, preview_scale(target, space), space.centre)
            return plain(shown, str(target.path), *corner)

        # The values of all layers, each channel once.
        channels: dict[str, NDArray[np.float32]] = {}
        for layer in _beauty_first(target.layers):
            values = composed[layer.name]
            values = bits_of(values) if layer.kind == "id" else values
            for k, name in enumerate(self.names(layer)):
                channels.setdefault(name, values[..., k])
        return np.stack(list(channels.values()), axis=-1)

    def composed(self, layer: Layer, layers: Mapping[str, NDArray[Any]]) -> NDArray[Any]:
        """The layer's pixels; the beauty over its background, or with its alpha if there is none."""
        values = layers[layer.name]
        if layer.buffer != "beauty":
            return values
        alpha = layers["alpha"]
        if self.background is None:
            return np.concatenate([values, alpha], axis=-1)
        background = np.asarray(self.background, np.float32)
        behind = background[:, None, None] * (1 - alpha[..., 0])  # channel by channel, as layers are kept
        return values + np.moveaxis(behind, 0, -1)

    def _has_alpha(self, layer: Layer) -> bool:
        return layer.buffer == "beauty" and self.background is None

    def names(self, layer: Layer) -> tuple[str, ...]:
        """The channels of a layer in an EXR."""
        return (*layer.channels, "A") if self._has_alpha(layer) else layer.channels


def _beauty_first(layers: Sequence[Layer]) -> list[Layer]:
    return sorted(layers, key=lambda layer: layer.buffer != "beauty")


def preview_scale(target: Target, space: RenderSpace) -> float:
    """The unit of distances in previews [scene units]: the scene's radius for positions, the distance from
    the camera to its target for depths."""
    if target.layers[0].preview == "position":
        return float(space.radius)
    camera = target.view.camera
    return float(np.linalg.norm(np.subtract(camera.target, camera.position)))


def how_to_read(target: Target, space: RenderSpace) -> dict[str, Any]:
    """Metadata about the meaning of a file's values."""
    if not target.is_png:
        return {"illum:depth": "distance from the eye's plane in scene units, 0 where nothing is seen"}
    if target.layers[0].kind != "light":
        return reading(target.layers[0], preview_scale(target, space), space.centre)
    return {}


@dataclass(slots=True)
class ErrorSums:
    """Mean and root mean square of the layer `error`, band by band."""

    pixels: int = 0
    total: float = 0.0
    square: float = 0.0

    def add(self, band: NDArray[np.float32]) -> None:
        """Add the rows of a band."""
        values = band.astype(np.float64)
        self.pixels += values.size
        self.total += float(values.sum())
        self.square += float(np.square(values).sum())

    def as_data(self) -> dict[str, float]:
        """The entries of a report."""
        return {"mean": self.total / self.pixels, "rms": math.sqrt(self.square / self.pixels)}
