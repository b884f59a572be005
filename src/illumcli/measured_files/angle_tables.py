"""Tables of a quantity over angles in degrees, as CSV: a column of theta, and a column for each phi.

    theta, p              theta, 0, 30, 60, 90
    0, 1                  0,     1, 1,  1,  1
    20, 0.4               20,    4, 2,  1,  0.5

The first line is a heading; one of two columns may do without. Lines that begin with # are left out. Columns
are separated by commas, semicolons or tabs. Rows and columns may be in any order.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError, LimitError
from illumcli.records import Record

MAX_BYTES = 1 << 26


class AngleTable(Record):
    """Values over theta and phi [degrees], both ascending."""

    theta: NDArray[np.float64]  # (R,) within 0..90
    phi: NDArray[np.float64] | None  # (C,) within 0..360; None for a single column without phi
    values: NDArray[np.float64]  # (R, C), at least 0
    mended: int
    """Values that were negative or not finite, and are 0."""


def read_angle_table(path: str) -> AngleTable:
    """The table in a file.

    Raises
    ------
    InputError
        The file cannot be read, or is no such table; with the line.
    """
    lines = _lines(Path(path))
    if not lines:
        raise InputError(f"{path}: has no rows; write a line of theta and a value for each angle")
    heading = lines[0][1]
    if len(heading) < 2:
        raise InputError(f"{path}:{lines[0][0]}: has one column; separate theta and its values by commas")
    has_heading = len(heading) > 2 or any(_number(word) is None for word in heading)
    rows = [(number, _numbers(path, number, words, len(heading))) for number, words in lines[has_heading:]]
    if len(rows) < 2:
        raise InputError(f"{path}: has {len(rows)} rows; a table needs at least two")

    # Sort rows by theta and columns by phi.
    table = np.array([row for _, row in rows])
    numbers = np.array([number for number, _ in rows])
    theta, order = _ascending(path, "theta", table[:, 0], 90.0, numbers)
    phi, columns = None, np.zeros(1, np.int64)
    if len(heading) > 2:
        written = np.array(_numbers(path, lines[0][0], ["0", *heading[1:]], len(heading))[1:])
        phi, columns = _ascending(path, "phi", written, 360.0, np.full(len(written), lines[0][0]))
    values = table[order][:, 1:][:, columns]
    wrong = ~(np.isfinite(values) & (values >= 0))
    return AngleTable(theta, phi, np.where(wrong, 0.0, values), int(np.count_nonzero(wrong)))


def _lines(path: Path) -> list[tuple[int, list[str]]]:
    """The numbers and cells of all lines with text."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise LimitError(f"{path}: more than {MAX_BYTES >> 20} MiB of text; leave rows out")
        text = path.read_text("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text (byte {error.start}); save the table as CSV") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None
    lines = enumerate((line.strip() for line in text.splitlines()), 1)
    return [
        (number, [cell.strip() for cell in re.split("[,;\t]", line)])
        for number, line in lines
        if line and not line.startswith("#")
    ]


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _numbers(path: str, line: int, words: list[str], count: int) -> list[float]:
    if len(words) != count:
        raise InputError(f"{path}:{line}: has {len(words)} columns, the first line has {count}")
    numbers = [_number(word) for word in words]
    for word, number in zip(words, numbers, strict=True):
        if number is None:
            raise InputError(f"{path}:{line}: '{word[:40]}' is no number; write it as 0.25")
    return [number for number in numbers if number is not None]


def _ascending(
    path: str, name: str, angles: NDArray[np.float64], most: float, lines: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Angles in ascending order, and that order; each once and within 0 to `most` degrees."""
    outside = ~((angles >= 0) & (angles <= most))
    if outside.any():
        first = int(np.flatnonzero(outside)[0])
        fact = f"must be 0 to {most:g} degrees, is {angles[first]:g}"
        raise InputError(f"{path}:{lines[first]}: {name} {fact}")
    order = np.argsort(angles, kind="stable")
    again = np.flatnonzero(np.diff(angles[order]) == 0)
    if again.size:
        first = order[again[0] + 1]
        raise InputError(f"{path}:{lines[first]}: {name} {angles[first]:g} is there twice; remove one")
    return angles[order], order
