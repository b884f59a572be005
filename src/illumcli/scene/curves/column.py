"""Column: the values of a CSV file, whose first line has the names of its columns.

A column `frame` or `time` [s] says where each row is; without one the rows are the frames 0, 1, 2 and so on.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from illumcli.keyframes import Interpolation
from illumcli.records import Value
from illumcli.scene.curves._base import Over, ReadFile
from illumcli.scene.curves._keys import (
    between,
    key_numbers,
    keys_over_surface,
    number_in,
    numeric,
    same_shape,
)
from illumcli.scene.curves._mapped import MappedCurve
from illumcli.scene.frames import Moment
from illumcli.schema.fields import ListOf
from illumcli.schema.messages import suggestion

AXES: tuple[Over, ...] = ("frame", "time")


class ColumnCurve(MappedCurve):
    curve: Literal["column"]
    file: str
    """Path of the CSV file, from the scene's folder."""
    column: Annotated[str | ListOf[str], Field(union_mode="left_to_right")]
    """Name of the column, or a list of names for the components of a vector or colour."""
    interpolation: Interpolation = "linear"
    """Between rows. `linear`: straight from row to row. `smooth`: as the curve of this name. `step`: each row
    holds until the next; for names and whole numbers."""

    def axis(self, read: ReadFile) -> Over:
        return self._read(read)[1].axis or "frame"

    def phi_at(self, moment: Moment, read: ReadFile) -> Any:
        path, track = self._read(read)
        if track.axis is None and moment.frame >= len(track.positions):
            missing = f"{path} has {len(track.positions)} rows, for frames 0 to {len(track.positions) - 1}"
            raise ValueError(f"{missing}; add rows, or a column frame")
        at = getattr(moment, track.axis or "frame")
        row = between(at, track.positions, track.values, self.interpolation)
        return row[0] if isinstance(self.column, str) else row

    def phi(self, moment: Moment, read: ReadFile) -> dict[str, Any]:
        _, track = self._read(read)
        return keys_over_surface(track.positions, track.values, self.interpolation)

    def _read(self, read: ReadFile) -> tuple[Path, _Track]:
        """Where the file is, and its columns."""
        path, text = read(self.file)
        names = (self.column,) if isinstance(self.column, str) else self.column
        return path, _track(text, str(path), names, self.interpolation)


class _Track(Value):
    """Columns of a table, by the positions of its rows."""

    axis: Over | None
    """Name of the column of positions; None if rows are numbered."""
    positions: list[float]
    values: list[Any]
    """A list of cells for each row."""


@lru_cache(maxsize=16)
def _track(text: str, path: str, names: tuple[str, ...], how: Interpolation) -> _Track:
    """The named columns of a CSV, whose cells are numbers unless `how` is `step`."""
    head, rows = _table(text, path)
    for name in names:
        if name not in head:
            raise ValueError(f"{path} has no column '{name}'; {suggestion(name, head)}")
    axis = next((name for name in AXES if name in head), None)
    written = [row[head.index(axis)] if axis else str(number) for number, row in enumerate(rows)]
    if len(set(written)) < len(written):
        raise ValueError(f"{path} has two rows with the same {axis}; remove one")
    by_text = dict(zip(written, rows, strict=True))
    numbers = key_numbers(by_text)
    values: list[Any] = [[_cell(by_text[key][head.index(name)]) for name in names] for _, key in numbers]
    if how != "step":
        values = same_shape([numeric(row) for row in values])
    return _Track(axis, [number for number, _ in numbers], values)


def _table(text: str, path: str) -> tuple[Sequence[str], list[list[str]]]:
    """The first line of a CSV and its rows; blank lines are left out."""
    try:
        lines = [line for line in csv.reader(io.StringIO(text, newline="")) if any(map(str.strip, line))]
    except csv.Error as error:
        raise ValueError(f"{path} cannot be read: {error}") from None
    if len(lines) < 2:
        raise ValueError(f"{path} has no rows; write the names of columns in its first line and values below")
    head, *rows = [[cell.strip() for cell in line] for line in lines]
    for number, row in enumerate(rows, 2):
        if len(row) != len(head):
            raise ValueError(f"{path}: row {number} has {len(row)} cells, the first line {len(head)}")
    return head, rows


def _cell(text: str) -> Any:
    """A cell as a number, if it is one."""
    number = number_in(text)
    return text if number is None else number
