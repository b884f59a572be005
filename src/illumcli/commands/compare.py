"""Compare two images layer by layer."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from illumcli import __version__
from illumcli.cache.fingerprint import digest, file_digest
from illumcli.files.outputs import is_kept, refresh, refuse_suffix
from illumcli.film.channels import ChannelType, Metadata
from illumcli.images.comparison import (
    LayerDifference,
    heat_picture,
    layer_differences,
    read_pair,
    shared_layers,
)
from illumcli.images.contents import image_contents
from illumcli.images.reader import Image
from illumcli.images.writer import ImageWriter
from illumcli.records import Value


class Comparison(Value):
    """Two images and how they differ."""

    reference: Path
    test: Path
    layers: tuple[LayerDifference, ...]
    only_in_reference: tuple[str, ...]  # channels
    only_in_test: tuple[str, ...]
    heat_scale: float | None  # the difference that is brightest in the heat image; None without one
    heat_is_kept: bool

    def as_data(self) -> dict[str, Any]:
        """The comparison for JSON; infinite values and NaN are null."""
        return {
            "reference": str(self.reference),
            "test": str(self.test),
            "layers": [layer.as_data() for layer in self.layers],
            "only_in_reference": list(self.only_in_reference),
            "only_in_test": list(self.only_in_test),
            "heat_scale": self.heat_scale,
        }


def compare_images(
    reference: Path,
    test: Path,
    names: Sequence[str] = (),
    flips: bool = True,
    heat_file: Path | None = None,
    force: bool = False,
) -> Comparison:
    """The differences of `test` from `reference`, by layer.

    Parameters
    ----------
    names
        Layers to compare; if empty, all that both files have.
    flips
        True to compute FLIP for layers with R, G and B; it takes far longer than the other measures.
    heat_file
        PNG of the largest difference over the channels of the first layer, in false colours. An existing
        one with the same content is kept.

    Raises
    ------
    InputError
        Unreadable files, files of different size or kind, unknown layers.
    OutputError
        The heat image cannot be written; a different file exists and `force` is not given.
    """
    if heat_file is not None:
        refuse_suffix(heat_file, "a heat picture", ".png")
    a, b = read_pair(reference, test)
    layers = shared_layers(a, b, names, f"{reference}, {test}")

    # Before measuring, check whether the heat image can be written or exists already.
    content, kept = "", False
    if heat_file is not None:
        content = digest((__version__, (file_digest(reference), file_digest(test)), next(iter(layers))))
        kept = is_kept(heat_file, [content], image_contents, force)

    # Measure, and write the heat image.
    differences = layer_differences(a, b, layers, flips)
    if heat_file is not None and kept:
        refresh(heat_file)
    elif heat_file is not None:
        _write_heat(heat_file, a, b, differences[0], content)
    return Comparison(
        reference=reference,
        test=test,
        layers=differences,
        only_in_reference=tuple(name for name in a.channels if name not in b.channels),
        only_in_test=tuple(name for name in b.channels if name not in a.channels),
        heat_scale=None if heat_file is None else differences[0].heat_scale,
        heat_is_kept=kept,
    )


def _write_heat(path: Path, a: Image, b: Image, layer: LayerDifference, content: str) -> None:
    scale = layer.heat_scale
    metadata: Metadata = {"illum:layer": layer.name, "illum:heat_scale": scale, "illum:content": content}
    types: dict[str, ChannelType] = dict.fromkeys("RGB", "uint8")
    with ImageWriter(path, a.width, a.height, types, metadata) as writer:
        writer.write_band(0, heat_picture(a, b, layer))
