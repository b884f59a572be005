"""The contact sheet of a sweep: an image of every variant, with its values below."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.commands.sweep_outcome import Outcome
from illumcli.commands.sweep_reference import written_colors
from illumcli.memory import refuse_beyond

SHEET_BYTES = 9
"""Bytes per pixel of a contact sheet: three colours, each in its cell, its row and the sheet."""


def refuse_large_sheet(path: Path, outcomes: Sequence[Outcome]) -> None:
    """Raise LimitError if a contact sheet does not fit into memory; all cells are as high as the highest."""
    from illumcli.images.contact_sheet import CELL_WIDTH

    images = [outcome.planned for outcome in outcomes if outcome.planned is not None]
    tallest = max((CELL_WIDTH * image.height // image.width for image in images), default=0)
    size = SHEET_BYTES * len(images) * CELL_WIDTH * (tallest + CELL_WIDTH // 8)
    what = f"{path}: a sheet of {len(images)} pictures, {CELL_WIDTH} x {tallest} pixels each"
    refuse_beyond(size, what, "leave --sheet out, or sweep in parts")


def write_sheet(path: Path, outcomes: Sequence[Outcome], content: str) -> None:
    """Write a contact sheet: the first image of every variant that has one, with its values below."""
    from illumcli.images.contact_sheet import write_contact_sheet

    rendered = [outcome for outcome in outcomes if outcome.report is not None]
    labels = [outcome.label for outcome in rendered]
    write_contact_sheet(path, map(_display_values, rendered), labels, content)


def _display_values(outcome: Outcome) -> NDArray[np.uint8]:
    """(H, W, 1 or 3) the first image of a variant as a screen shows it."""
    from illumcli.film.encode import picture

    assert outcome.planned is not None
    pixels, encoded = written_colors(outcome.paths[0])
    if encoded:
        return np.rint(pixels * 255).astype(np.uint8)
    return picture(pixels, outcome.planned.exposure, 8, str(outcome.paths[0]))
