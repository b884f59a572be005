"""The images that `--reference` names: measures in a sweep's table are relative to them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

from illumcli.cache.fingerprint import file_digest
from illumcli.commands.sweep_outcome import Outcome, PlannedVariant
from illumcli.errors import InputError
from illumcli.files.names import fields
from illumcli.film.channels import channel_count
from illumcli.records import Value

MAX_DIGITS = 9
"""Digits of a variant's number; a longer text is the name of a file."""


_Images: TypeAlias = Mapping[Path, tuple[int, PlannedVariant]]
"""First images of this sweep -> their variants."""


class Reference(Value):
    """An image that others are compared with."""

    path: Path
    content: str
    number: int | None = None
    """Number of the variant whose image it is; None for another image."""


class _Kind(Value):
    """The properties that images must share to be compared."""

    height: int
    width: int
    channels: int
    encoded: bool  # display values; else linear light


def references_of(text: str, outcomes: Sequence[Outcome]) -> dict[int, Reference]:
    """Number of a variant -> the image that its first one is compared with; variants with a fault have none.

    Parameters
    ----------
    text : str
        What `--reference` names: a variant's first image, by its number or its file, another image, or a
        pattern of names with an image for each variant.

    Raises
    ------
    InputError
        An image does not exist, is no image, or differs in size or kind from the one of its variant.
    """
    variants = {each.number: each.planned for each in outcomes if each.planned is not None}
    images = {variant.paths[0]: (number, variant) for number, variant in variants.items()}
    if fields(text):
        return _of_pattern(text, variants, images)
    number = _variant_number(text, len(outcomes), variants)
    path = Path(text) if number is None else variants[number].paths[0]
    reference, kind = _reference(path, images)
    for variant in variants.values():
        if fault := _misfit(variant, kind):
            raise InputError(f"--reference {text}: {fault}")
    return dict.fromkeys(variants, reference)


def _of_pattern(text: str, variants: Mapping[int, PlannedVariant], images: _Images) -> dict[int, Reference]:
    """An image for each variant."""
    references, problems = {}, []
    for number, variant in variants.items():
        assert variant.reference is not None
        try:
            references[number], kind = _reference(variant.reference, images)
            if fault := _misfit(variant, kind):
                problems.append(fault)
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError([f"--reference {text}: {problem}" for problem in dict.fromkeys(problems)])
    return references


def _reference(path: Path, images: _Images) -> tuple[Reference, _Kind]:
    """The image of a variant, or a file that is there; reads its header and hashes it."""
    if path in images:
        number, variant = images[path]
        return Reference(path, variant.images[0].content, number), _kind(variant)
    return Reference(path, file_digest(path)), _kind_of_file(path)


def _misfit(variant: PlannedVariant, kind: _Kind) -> str:
    """Why the first image of a variant cannot be compared with one of this kind; empty if it can."""
    fault = _difference(_kind(variant), kind)
    return f"{variant.paths[0]} {fault}; take a picture of the same kind and size" if fault else ""


def _variant_number(text: str, count: int, variants: Mapping[int, PlannedVariant]) -> int | None:
    """The variant that `text` gives the number of; None where it names a file."""
    if text.isascii() and text.isdecimal() and len(text) <= MAX_DIGITS:
        number = int(text)
        if not 1 <= number <= count:
            raise InputError(f"--reference {text}: there are variants 1 to {count}")
        if number not in variants:
            raise InputError(f"--reference {text}: this variant has a fault; take another")
        return number
    return None


def _kind(variant: PlannedVariant) -> _Kind:
    """Of a variant's first image."""
    encoded = variant.paths[0].suffix.lower() == ".png"
    return _Kind(variant.height, variant.width, variant.channels, encoded)


def _kind_of_file(path: Path) -> _Kind:
    """Of an image, by its header."""
    from illumcli.images.reader import ImageSource

    with ImageSource(path) as image:
        return _Kind(image.height, image.width, channel_count(image.names), image.encoded)


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
