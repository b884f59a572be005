"""The contact sheet of a sweep: an image of every variant, its values at the sides or below."""

from __future__ import annotations

import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.commands.sweep_colors import written_colors
from illumcli.commands.sweep_outcome import Outcome
from illumcli.errors import InputError
from illumcli.files.outputs import refuse_suffix
from illumcli.files.reports import report_contents
from illumcli.images.contents import image_contents
from illumcli.images.sheet_layout import Sheet, laid_out
from illumcli.memory import refuse_beyond
from illumcli.scene.variants import Variant

PICTURE_BYTES = 19
"""Bytes per pixel of a picture that is read, encoded and reduced."""
SHEET_BYTES = 9
"""Bytes per pixel of a row of the sheet."""


def sheet_of(variants: Sequence[Variant], columns: int | None = None) -> Sheet:
    """Where the picture of each variant stands.

    If the values of what varies fastest are combined with all other values, they stand along x and the others
    along y. Otherwise, and with `columns`, pictures follow each other and have captions.
    """
    across = _across(variants)
    if columns is None and 0 < len(across) < len(variants):
        starts = range(0, len(variants), len(across))
        cells = tuple(tuple(range(start, start + len(across))) for start in starts)
        return Sheet(cells, (), across, tuple(", ".join(variants[start].parts[:-1]) for start in starts))
    count = len(variants)
    columns = columns or max(1, round((count * 1.6) ** 0.5))
    numbers = [*range(count), *[None] * (-count % columns)]
    wrapped = tuple(tuple(numbers[k : k + columns]) for k in range(0, len(numbers), columns))
    return Sheet(wrapped, tuple(each.label or f"variant {k}" for k, each in enumerate(variants, 1)))


def _across(variants: Sequence[Variant]) -> tuple[str, ...]:
    """The parts of labels along x; those of all variants, or none, if they are no grid."""
    last = tuple(dict.fromkeys(each.parts[-1:] for each in variants))
    count = len(last)
    is_grid = len(variants) % count == 0 and all(
        each.parts[-1:] == last[k % count] and each.parts[:-1] == variants[k - k % count].parts[:-1]
        for k, each in enumerate(variants)
    )
    heads = last if is_grid else [each.parts[-1:] for each in variants]
    return tuple(part for parts in heads for part in parts)


def refuse_sheet(path: Path, outcomes: Sequence[Outcome], columns: int | None) -> None:
    """Refuse a sheet that is certain to fail; reads no picture.

    Raises
    ------
    InputError
        An unknown suffix, the name of a picture, or matplotlib is not installed.
    LimitError
        The largest picture and a row of the sheet do not fit into memory.
    """
    from illumcli.images.contact_sheet import SUFFIXES
    from illumcli.images.sheet_drawing import refuse_without_matplotlib

    refuse_suffix(path, "a contact sheet", *SUFFIXES)
    if _file(path) in {_file(picture) for outcome in outcomes for picture in outcome.paths}:
        raise InputError(f"--sheet {path}: a picture of the sweep has this name; give the sheet another")
    refuse_without_matplotlib(path)
    sizes = _sizes(outcomes)
    layout = laid_out(sheet_of([each.variant for each in outcomes], columns), sizes)
    at_once = layout.width * max(row.height for row in layout.rows)
    if path.suffix.lower() != ".png":
        at_once = layout.width * layout.height
    largest = max(sizes, key=lambda size: size[0] * size[1])
    need = SHEET_BYTES * at_once + PICTURE_BYTES * largest[0] * largest[1]
    what = f"{path}: a sheet of {len(sizes)} pictures, up to {largest[1]} x {largest[0]} pixels"
    refuse_beyond(need, what, "leave --sheet out, or sweep in parts")


def _file(path: Path) -> str:
    """The file that a path names, on file systems that ignore case."""
    return os.path.abspath(path).casefold()


def write_sheet(path: Path, outcomes: Sequence[Outcome], columns: int | None, content: str) -> None:
    """Write a contact sheet: the first image of every variant, white where there is none."""
    from illumcli.images.contact_sheet import write_contact_sheet

    sheet = sheet_of([outcome.variant for outcome in outcomes], columns)
    pictures = [partial(_display_values, outcome) for outcome in outcomes]
    write_contact_sheet(path, sheet, pictures, _sizes(outcomes), content)


def sheet_contents(path: Path) -> list[str]:
    """The content hash of a contact sheet."""
    return image_contents(path) if path.suffix.lower() == ".png" else report_contents(path)


def _sizes(outcomes: Sequence[Outcome]) -> list[tuple[int, int]]:
    """Height and width of the first image of every variant; a variant with a fault has a pixel."""
    planned = (outcome.planned for outcome in outcomes)
    return [(image.height, image.width) if image else (1, 1) for image in planned]


def _display_values(outcome: Outcome) -> NDArray[np.uint8]:
    """(H, W, 1 or 3) the first image of a variant as a screen shows it; one that failed has a white pixel."""
    from illumcli.film.encode import picture

    if outcome.report is None or outcome.planned is None:
        return np.full((1, 1, 1), 255, np.uint8)
    pixels, encoded = written_colors(outcome.paths[0])
    if encoded:
        return np.rint(pixels * 255).astype(np.uint8)
    return picture(pixels, outcome.planned.exposure, 8, str(outcome.paths[0]))
