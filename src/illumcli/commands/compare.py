"""Compares two images layer by layer."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli import __version__
from illumcli.cache.fingerprint import digest, file_digest
from illumcli.errors import InputError, ThresholdError
from illumcli.files.outputs import is_kept, refresh, refuse_suffix
from illumcli.film.heat import heat
from illumcli.film.metrics import Difference, absolute_difference, difference
from illumcli.images.channels import ChannelType, Metadata, group_by_layer
from illumcli.images.contents import image_contents
from illumcli.images.flip import flip
from illumcli.images.reader import Image, read_image
from illumcli.images.writer import ImageWriter
from illumcli.records import Value
from illumcli.schema.families import suggestion

LIMITS = {
    "max_rmse": "RMSE",
    "max_mae": "MAE",
    "max_relative": "relative MSE",
    "min_psnr": "PSNR",
    "max_flip": "FLIP",
    "max_difference": "largest difference",
}


class LayerDifference(Value):
    """One layer of two images."""

    name: str
    channels: tuple[str, ...]
    difference: Difference
    flip: float | None  # mean FLIP error; None unless it has R, G and B, all finite, and FLIP was asked for

    def measures(self) -> dict[str, float]:
        """Name of a limit -> what it limits."""
        d = self.difference
        found = {
            "max_rmse": d.rmse,
            "max_mae": d.mae,
            "max_relative": d.relative_mse,
            "min_psnr": d.psnr,
            "max_difference": d.largest,
        }
        return found if self.flip is None else {**found, "max_flip": self.flip}

    @property
    def place(self) -> tuple[int, int, str]:
        """x, y and channel of the largest difference, from the upper left pixel 0, 0."""
        row, column, channel = self.difference.place
        return column, row, self.channels[channel]


class Comparison(Value):
    """What `run` found."""

    reference: Path
    test: Path
    layers: tuple[LayerDifference, ...]
    only_in_reference: tuple[str, ...]  # channels
    only_in_test: tuple[str, ...]
    heat_scale: float | None  # the value that is brightest in the heat picture, where there is one
    heat_is_kept: bool


def run(
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
        Layers to compare; all that both files have when empty.
    flips
        Whether FLIP is computed for layers with R, G and B; it takes far longer than all else.
    heat_file
        PNG of the largest difference over the channels of the first layer, in false colours. One that is
        there with the same content is kept.

    Raises
    ------
    InputError
        Unreadable files, files of different size or kind, unknown layers.
    OutputError
        The heat picture cannot be written; a different file is there and `force` is not given.
    """
    if heat_file is not None:
        refuse_suffix(heat_file, "a heat picture", ".png")
    a, b = _read_both(reference, test)
    shared = group_by_layer(name for name in a.channels if name in b.channels)
    compared = _chosen(shared, names, f"{reference}, {test}")
    kept, content = False, ""
    if heat_file is not None:
        files = file_digest(reference), file_digest(test)
        content = digest((__version__, files, next(iter(compared))))
        kept = is_kept(heat_file, [content], image_contents, force)
    found = [_layer(a, b, name, channels, flips) for name, channels in compared.items()]
    if heat_file is not None and kept:
        refresh(heat_file)
    elif heat_file is not None:
        _write_heat(heat_file, a, b, found[0], content)
    return Comparison(
        reference=reference,
        test=test,
        layers=tuple(found),
        only_in_reference=tuple(name for name in a.channels if name not in b.channels),
        only_in_test=tuple(name for name in b.channels if name not in a.channels),
        heat_scale=None if heat_file is None else _heat_scale(found[0]),
        heat_is_kept=kept,
    )


def check(comparison: Comparison, limits: Mapping[str, float]) -> None:
    """Nothing, where every layer keeps every limit; limits by their names in `LIMITS`.

    Raises
    ------
    ThresholdError
        Each measure beyond its limit; NaN is beyond any.
    InputError
        A limit on FLIP where no layer has one.
    """
    if "max_flip" in limits and not any(_colours(layer.channels) for layer in comparison.layers):
        raise InputError(
            f"{comparison.test}: no layer compared has R, G and B; limit something else than FLIP"
        )
    beyond = []
    for layer in comparison.layers:
        measures = layer.measures()
        for limit, bound in limits.items():
            value = measures.get(limit)
            if value is not None and not (value >= bound if limit == "min_psnr" else value <= bound):
                side = "below" if limit == "min_psnr" else "above"
                beyond.append(
                    f"{comparison.test}: {layer.name}: {LIMITS[limit]} is {value:.6g}, {side} {bound:g}"
                )
        count = layer.difference.not_finite
        if limits and count:
            beyond.append(f"{comparison.test}: {layer.name}: {count} values are NaN or infinite in one image")
    if beyond:
        raise ThresholdError("\n".join(beyond))


def as_data(comparison: Comparison) -> dict[str, Any]:
    """The comparison as plain data for JSON; what is infinite or not a number is null."""
    return {
        "reference": str(comparison.reference),
        "test": str(comparison.test),
        "layers": [
            {
                "layer": layer.name,
                "channels": list(layer.channels),
                "rmse": _number(layer.difference.rmse),
                "relative_mse": _number(layer.difference.relative_mse),
                "mae": _number(layer.difference.mae),
                "psnr": _number(layer.difference.psnr),
                "flip": layer.flip,
                "largest": layer.difference.largest,
                "at": dict(zip(("x", "y", "channel"), layer.place, strict=True)),
                "not_finite": layer.difference.not_finite,
            }
            for layer in comparison.layers
        ],
        "only_in_reference": list(comparison.only_in_reference),
        "only_in_test": list(comparison.only_in_test),
        "heat_scale": comparison.heat_scale,
    }


def as_table(comparison: Comparison) -> str:
    """The comparison as a table to read, one line per layer, and what could not be compared."""
    titles = (
        "layer",
        "channels",
        "RMSE",
        "rel. MSE",
        "MAE",
        "PSNR",
        "FLIP",
        "largest",
        "at x, y",
        "not finite",
    )
    rows = [titles, *(_row(layer) for layer in comparison.layers)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
    for path, only in (
        (comparison.reference, comparison.only_in_reference),
        (comparison.test, comparison.only_in_test),
    ):
        if only:
            lines.append(f"only in {path}: {', '.join(only)}")
    return "\n".join(lines)


def _row(layer: LayerDifference) -> tuple[str, ...]:
    d, (x, y, channel) = layer.difference, layer.place
    return (
        layer.name,
        " ".join(name.rpartition(".")[2] for name in layer.channels),
        *(f"{value:.4g}" for value in (d.rmse, d.relative_mse, d.mae, d.psnr)),
        "-" if layer.flip is None else f"{layer.flip:.4g}",
        f"{d.largest:.4g}",
        f"{x}, {y} {channel.rpartition('.')[2]}" if d.largest else "-",
        str(d.not_finite),
    )


def _read_both(reference: Path, test: Path) -> tuple[Image, Image]:
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
    if (a.width, a.height) != (b.width, b.height):
        sizes = f"{b.width} x {b.height}, but {reference} is {a.width} x {a.height}"
        raise InputError(f"{test}: is {sizes}; compare images of one size")
    if a.encoded != b.encoded:
        kinds = "linear light", "display values"
        fact = f"holds {kinds[b.encoded]}, but {reference} {kinds[a.encoded]}"
        raise InputError(f"{test}: {fact}; compare two files of a kind")
    return a, b


def _chosen(
    shared: Mapping[str, tuple[str, ...]], names: Iterable[str], place: str
) -> dict[str, tuple[str, ...]]:
    """The layers to compare, in the order asked for."""
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


def _layer(a: Image, b: Image, name: str, channels: tuple[str, ...], flips: bool) -> LayerDifference:
    reference, test = _stacked(a, channels), _stacked(b, channels)
    found = difference(reference, test, peak=1.0 if a.encoded else None)
    colours = _colours(channels)
    error = _flip(_stacked(a, colours), _stacked(b, colours), a.encoded) if flips and colours else None
    return LayerDifference(name, channels, found, error)


def _colours(channels: Sequence[str]) -> list[str]:
    """The channels R, G and B of a layer, empty unless it has all three."""
    colours = [channel for channel in channels if channel.rpartition(".")[2] in tuple("RGB")]
    return colours if len(colours) == 3 else []


def _flip(reference: NDArray[np.float32], test: NDArray[np.float32], encoded: bool) -> float | None:
    if np.array_equal(reference, test):
        return 0.0
    if not (np.isfinite(reference).all() and np.isfinite(test).all()):
        return None
    return flip(reference, test, encoded)[0]


def _stacked(image: Image, channels: Sequence[str]) -> NDArray[np.float32]:
    return np.stack([image.channels[channel] for channel in channels], axis=-1)


def _heat_scale(layer: LayerDifference) -> float:
    return layer.difference.largest or 1.0


def _write_heat(path: Path, a: Image, b: Image, layer: LayerDifference, content: str) -> None:
    scale = _heat_scale(layer)
    metadata: Metadata = {"illum:layer": layer.name, "illum:heat_scale": scale, "illum:content": content}
    types: dict[str, ChannelType] = dict.fromkeys("RGB", "uint8")
    worst = absolute_difference(_stacked(a, layer.channels), _stacked(b, layer.channels)).max(axis=-1)
    with ImageWriter(path, a.width, a.height, types, metadata) as writer:
        writer.write_band(0, heat(worst, scale))


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
