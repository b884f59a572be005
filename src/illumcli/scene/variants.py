"""The variants of a scene in a sweep, from `-D`, `--rows` and `--frames`."""

from __future__ import annotations

import csv
import io
import itertools
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from illumcli.errors import InputError, LimitError
from illumcli.geometry.formula import parse as formula
from illumcli.records import Value
from illumcli.scene.source import MAX_DEPTH
from illumcli.schema.messages import short

MAX_VARIANTS = 100_000
MAX_TABLE_BYTES = 2**26
LAST_FRAME = 2**53
"""Formulas of `frame` are computed in double precision."""

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE = re.compile(rf"({_NUMBER}):({_NUMBER}):(\d+)(log)?")


class Axis(Value):
    """A path in the scene and its values, as YAML."""

    path: str
    values: tuple[str, ...]


class Variant(Value):
    """A variant of a scene: the value of each path that varies, and the frame."""

    values: Mapping[str, str]
    frame: int = 0

    @property
    def overrides(self) -> list[str]:
        """The values in the form of `-D`."""
        return [f"{path}={value}" for path, value in self.values.items()]

    @property
    def label(self) -> str:
        """The last part of each path, and its value."""
        return ", ".join(f"{path.rpartition('.')[2]} {value}" for path, value in self.values.items())


def variants_of(
    texts: Sequence[str], together: bool = False, rows: Path | None = None, frames: str | None = None
) -> list[Variant]:
    """The variants that a sweep's options describe.

    Parameters
    ----------
    texts : sequence of str
        `PATH=a,b,c`, `PATH=START:STOP:COUNT` or `PATH=START:STOP:COUNTlog`, the arguments of `-D`.
    together : bool
        Combine the first values, the second values, and so on; otherwise every value with every other, the
        last path fastest.
    rows : Path, optional
        CSV: paths in its first line, the values of a variant in each other line.
    frames : str, optional
        `FIRST:LAST` or `FIRST:LAST:STEP`, both ends included; values may be formulas of `frame`.

    Raises
    ------
    InputError
    """
    # Values of each path, rows of the table, frames; refuse too many.
    numbers = _frames(frames) if frames else None
    axes = [axis_of(text) for text in texts]
    table = _rows(rows) if rows else [{}]
    lengths = [len(axis.values) for axis in axes]
    count = max(lengths, default=1) if together else math.prod(lengths)
    count *= len(table) * (1 if numbers is None else len(numbers))
    if count > MAX_VARIANTS:
        raise InputError(f"{count} variants are more than {MAX_VARIANTS}; sweep them in parts")

    # All combinations of them.
    grid = list(_together(axes) if together else _grid(axes))
    variants = []
    for row, point in itertools.product(table, grid):
        values = {**row, **point}
        if numbers is None:
            variants.append(Variant(values))
        else:
            variants += [
                Variant({path: at_frame(path, value, n) for path, value in values.items()}, n)
                for n in numbers
            ]
    return variants


def axis_of(text: str) -> Axis:
    """The path and values that `PATH=VALUES` describes."""
    path, equals, value = text.partition("=")
    if not equals or not path.strip():
        raise InputError(f"-D {text}: write PATH=a,b,c or PATH=START:STOP:COUNT")
    if span := _RANGE.fullmatch(value.strip()):
        return Axis(path.strip(), _range(text, span))
    values = tuple(part.strip() for part in split_at_commas(value))
    if not all(values):
        raise InputError(f"-D {text}: a value is empty; write null to take a part away")
    return Axis(path.strip(), values)


def _range(text: str, span: re.Match[str]) -> tuple[str, ...]:
    """COUNT numbers from START to STOP, both included, with equal steps or, for `log`, equal ratios."""
    if len(span[3]) > len(str(MAX_VARIANTS)) or not 1 <= int(span[3]) <= MAX_VARIANTS:
        raise InputError(f"-D {short(text)}: the count must be from 1 to {MAX_VARIANTS}")
    first, last, count = float(span[1]), float(span[2]), int(span[3])
    if not (math.isfinite(first) and math.isfinite(last)):
        raise InputError(f"-D {short(text)}: both ends must be finite numbers")
    if span[4] and not (first > 0 and last > 0):
        raise InputError(f"-D {text}: a logarithmic range has both ends above 0")
    values = np.geomspace(first, last, count) if span[4] else np.linspace(first, last, count)
    return tuple(written_number(value) for value in values)


def written_number(value: float) -> str:
    """The shortest decimal that reads as `value` to 12 digits; whole numbers without a point."""
    value = float(f"{value:.12g}")
    return str(int(value)) if value.is_integer() and abs(value) < 2**53 else repr(value)


def split_at_commas(text: str) -> list[str]:
    """The parts of `text` between commas; commas inside brackets and quotes do not count."""
    parts, depth, quote, start = [], 0, "", 0
    for index, letter in enumerate(text):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        elif letter in "([{":
            depth += 1
        elif letter in ")]}":
            depth -= 1
        elif letter == "," and depth == 0:
            parts.append(text[start:index])
            start = index + 1
    return [*parts, text[start:]]


def at_frame(path: str, value: str, frame: int) -> str:
    """`value` with every formula of `frame` evaluated."""
    text = value.strip()
    if not re.search(r"\bframe\b", text):
        return text
    if text.startswith("[" * MAX_DEPTH):
        raise InputError(f"-D {path}={short(value)}: nested deeper than {MAX_DEPTH} levels")
    if text.startswith("[") and text.endswith("]"):
        return f"[{', '.join(at_frame(path, part, frame) for part in split_at_commas(text[1:-1]))}]"
    try:
        number = float(formula(text, ("frame",)).value(frame))
    except ValueError as error:
        raise InputError(f"-D {path}={value}: {error}") from None
    if not math.isfinite(number):
        raise InputError(f"-D {path}={value}: is not a finite number at frame {frame}")
    return written_number(number)


def _frames(text: str) -> range:
    span = re.fullmatch(r"(\d+):(\d+)(?::(\d+))?", text, re.ASCII)
    if span and max(len(digits) for digits in span.groups("")) > len(str(LAST_FRAME)):
        raise InputError(f"--frames {short(text)}: frames are counted up to {LAST_FRAME}")
    first, last, step = (int(digits) for digits in span.groups("1")) if span else (0, -1, 1)
    if last < first or step == 0:
        raise InputError(f"--frames {short(text)}: write FIRST:LAST or FIRST:LAST:STEP, as in 0:119")
    if last > LAST_FRAME:
        raise InputError(f"--frames {text}: frames are counted up to {LAST_FRAME}")
    return range(first, last + 1, step)


def _grid(axes: Sequence[Axis]) -> Iterator[dict[str, str]]:
    for values in itertools.product(*(axis.values for axis in axes)):
        yield dict(zip((axis.path for axis in axes), values, strict=True))


def _together(axes: Sequence[Axis]) -> Iterator[dict[str, str]]:
    count = max((len(axis.values) for axis in axes), default=1)
    odd = [axis for axis in axes if len(axis.values) not in (1, count)]
    if odd:
        raise InputError(
            [f"-D {axis.path}: has {len(axis.values)} values, others {count}; --zip wants as many or one"
             for axis in odd]
        )  # fmt: skip
    for k in range(count):
        yield {axis.path: axis.values[k % len(axis.values)] for axis in axes}


def _rows(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV of overrides, path -> value."""
    # Read the lines that are not blank.
    try:
        with path.open("rb") as file:
            text = file.read(MAX_TABLE_BYTES + 1)
        if len(text) > MAX_TABLE_BYTES:
            raise LimitError(f"{path}: larger than {MAX_TABLE_BYTES} bytes; sweep its rows in parts")
        cells = csv.reader(io.StringIO(text.decode("utf-8-sig"), newline=""))
        lines = [line for line in cells if any(cell.strip() for cell in line)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None

    # Paths in the first line, values in all others.
    if len(lines) < 2:
        raise InputError(f"{path}: has no rows; write the paths in its first line and values below")
    head = [cell.strip() for cell in lines[0]]
    problems = [
        f"{path}: row {number} has {len(line)} cells, the first line {len(head)}"
        for number, line in enumerate(lines[1:], 2)
        if len(line) != len(head)
    ]
    if not all(head) or len(set(head)) < len(head):
        problems.append(f"{path}: the first line must name a different path for every column")
    if problems:
        raise InputError(problems)
    return [dict(zip(head, (cell.strip() for cell in line), strict=True)) for line in lines[1:]]
