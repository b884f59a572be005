"""The image that `--reference` names: errors in a sweep's table are relative to it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.cache.fingerprint import file_digest
from illumcli.commands.sweep_outcome import Outcome, PlannedVariant
from illumcli.errors import InputError, OutputError
from illumcli.records import Record, Value

MAX_DIGITS = 9
"""Digits of a variant's number; a longer text is the name of a file."""


class Reference(Record):
    """An image that others are compared with."""

    content: str
    number: int | None = None
    """Number of the variant whose image it is; None for another image."""
    pixels: NDArray[np.float32] | None = None
    """(H, W, 1 or 3) of another image; None for a variant's."""


class _Kind(Value):
    """The properties that images must share to be compared."""

    height: int
    width: int
    channels: int
    encoded: bool  # display values; else linear light


def reference_of(text: str, outcomes: Sequence[Outcome]) -> Reference:
    """The image that `--reference` names: a variant's first one, by its number or its file, or another image.

    Raises
    ------
    InputError
        It does not exist, is no image, or differs in size or kind from the image of a variant.
    """
    variants = {each.number: each.planned for each in outcomes if each.planned is not None}
    number = _variant_number(text, len(outcomes), variants)
    if number is not None:
        kind, reference = _kind(variants[number]), Reference(variants[number].image_content, number)
    else:
        pixels, encoded = colors(Path(text))
        height, width, count = pixels.shape
        kind, reference = (
            _Kind(height, width, count, encoded),
            Reference(file_digest(Path(text)), None, pixels),
        )
    for variant in variants.values():
        if fault := _difference(_kind(variant), kind):
            name = f"--reference {text}: {variant.paths[0]}"
            raise InputError(f"{name} {fault}; take a picture of the same kind and size")
    return reference


def _variant_number(text: str, count: int, variants: dict[int, PlannedVariant]) -> int | None:
    """The number of the variant that `text` names; None where it names another file."""
    if text.isascii() and text.isdecimal() and len(text) <= MAX_DIGITS:
        number = int(text)
        if not 1 <= number <= count:
            raise InputError(f"--reference {text}: there are variants 1 to {count}")
        if number not in variants:
            raise InputError(f"--reference {text}: this variant has a fault; take another")
        return number
    return next((each for each, variant in variants.items() if variant.paths[0] == Path(text)), None)


def _kind(variant: PlannedVariant) -> _Kind:
    """Of a variant's first image."""
    encoded = variant.paths[0].suffix.lower() == ".png"
    return _Kind(variant.height, variant.width, variant.channels, encoded)


def _difference(kind: _Kind, reference: _Kind) -> str:
    """How an image differs from the reference; empty if they can be compared."""
    if (kind.height, kind.width) != (reference.height, reference.width):
        size = f"{reference.width} x {reference.height}"
        return f"is {kind.width} x {kind.height}, the reference {size}"
    if kind.channels != reference.channels:
        return f"has {kind.channels} channels, the reference {reference.channels}"
    if kind.encoded != reference.encoded:
        kinds = "linear light", "display values"
        return f"holds {kinds[kind.encoded]}, the reference {kinds[reference.encoded]}"
    return ""


def channel_count(names: Collection[str]) -> int:
    """3 where an image with these channels has colours, else 1: its first channel."""
    return 3 if {"R", "G", "B"} <= set(names) else 1


def colors(path: Path) -> tuple[NDArray[np.float32], bool]:
    """(H, W, 3) R, G and B of an image, or (H, W, 1) its first channel if it has no colours; and whether the
    values are display values."""
    from illumcli.images.reader import read_image

    image = read_image(path)
    names = ("R", "G", "B") if channel_count(image.channels) == 3 else (next(iter(image.channels)),)
    return np.stack([image.channels[name] for name in names], axis=-1), image.encoded


def written_colors(path: Path) -> tuple[NDArray[np.float32], bool]:
    """The `colors` of an image that this sweep wrote.

    Raises
    ------
    OutputError
        It does not exist any more.
    """
    try:
        return colors(path)
    except InputError as error:
        raise OutputError(f"{path}: was written, but has been removed since; run the sweep again") from error
