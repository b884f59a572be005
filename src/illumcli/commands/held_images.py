"""Images that are held in memory for a caller in this process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from illumcli.commands.image_store import OpenImage
from illumcli.film.channels import ChannelType, numbers_of
from illumcli.film.develop import Target
from illumcli.film.finite import refuse_nonfinite
from illumcli.layers import Layer
from illumcli.records import Record
from illumcli.render_space import RenderSpace

if TYPE_CHECKING:
    from illumcli.commands.work import Work


class HeldImage(Record):
    """An image in memory, as a file of floats would hold it."""

    work: Work
    target: Target
    space: RenderSpace
    texts: dict[str, str]
    """What was added to its metadata."""
    pixels: NDArray[np.float32]  # (H, W, C) in the order of `channels`
    clamped: int = 0

    @property
    def channels(self) -> Mapping[str, ChannelType]:
        """Channel name -> its type in a file."""
        return self.work.development.channels(self.target)

    def layers(self) -> dict[str, NDArray[Any]]:
        """Layer -> (H, W, C) float32; ids are uint32."""
        numbers = {name: c for c, name in enumerate(self.channels)}
        return {
            layer.name: self._layer(layer, [numbers[name] for name in self.work.development.names(layer)])
            for layer in self.target.layers
        }

    def display(self, layer: str, layers: Mapping[str, NDArray[Any]]) -> NDArray[np.uint8]:
        """(H, W, C) one of its `layers` in 8 bits, as a PNG of it holds them."""
        (chosen,) = (each for each in self.target.layers if each.name == layer)
        target = replace(self.target, path=Path("picture.png"), layers=(chosen,))
        pixels: NDArray[np.uint8] = self.work.development.encoded(target, layers, (0, 0), self.space)
        return pixels

    def _layer(self, layer: Layer, numbers: list[int]) -> NDArray[Any]:
        values = np.ascontiguousarray(self.pixels[..., numbers])
        return numbers_of(values) if layer.kind == "id" else values

    def write_band(self, y0: int, band: NDArray[Any]) -> None:
        """Set the rows from `y0` on.

        Raises
        ------
        IllumError
            NaN or Inf in the band.
        """
        numbers = [c for c, kind in enumerate(self.channels.values()) if kind != "uint"]
        names = list(self.channels)
        refuse_nonfinite(band[..., numbers], [names[c] for c in numbers], str(self.target.path), y0)
        self.pixels[y0 : y0 + len(band)] = band

    def set_text(self, name: str, text: str) -> None:
        """Set a text of the metadata."""
        self.texts[name] = text

    def close(self) -> Self:
        """The image."""
        return self

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Nothing is to be tidied."""


class HeldImages(Record):
    """Keeps images in memory; nothing is written."""

    held: bool = True
    images: list[HeldImage] = field(default_factory=list)
    """In the order in which they were begun."""

    def due(self, targets: Sequence[Target], force: bool) -> list[Target]:
        """All of them."""
        return list(targets)

    def open(self, work: Work, target: Target, space: RenderSpace, texts: Mapping[str, str]) -> OpenImage:
        """An image of zeros that is filled band by band."""
        shape = (target.height, target.view.width, len(work.development.channels(target)))
        image = HeldImage(work, target, space, dict(texts), np.zeros(shape, np.float32))
        self.images.append(image)
        return image
