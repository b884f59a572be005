"""The variants of a scene in a sweep, from `-D`, `--rows` and `--frames`."""

from __future__ import annotations

import csv
import io
import itertools
import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from pathlib import Path

import numpy as np

from illumcli.errors import InputError, LimitError
from illumcli.records import Value
from illumcli.scene.curves._formula import NotFiniteError, formula_at
from illumcli.scene.frames import FRAMES_PER_SECOND, Frames, Moment, frame_numbers
from illumcli.scene.source import MAX_DEPTH
from illumcli.schema.messages import short

MAX_VARIANTS = 100_000
MAX_TABLE_BYTES = 2**26

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE = re.compile(rf"({_NUMBER}):({_NUMBER}):(\d+)(log)?")
_NAMED = re.compile(r"([A-Za-z_][\w.+-]*):(?![\s/\\])(.+)", re.DOTALL)
"""NAME:VALUE. A colon before a space belongs to YAML, one before a slash to a file or an address."""
LABEL = "label"
"""The column of `--rows` that names the rows."""


class Axis(Value):
    """A path in the scene and its values, as YAML."""

    path: str
    values: tuple[str, ...]
    names: tuple[str, ...]
    """Name of each value: its own text where it was given none."""


class Variant(Value):
    """A variant of a scene: the value of each path that varies, and the frame."""

    values: Mapping[str, str]
    frame: int | None = None
    """None if there are no frames."""
    names: Mapping[str, str] = field(default_factory=dict)
    """Path -> name of its value, by default the value. The name of a row, as `label`, replaces its paths."""
    parts: tuple[str, ...] = ()
    """What differs from other variants, what varies fastest last: names, other values after the last part of
    their paths, the frame."""

    @property
    def overrides(self) -> list[str]:
        """The values in the form of `-D`."""
        return [f"{path}={value}" for path, value in self.values.items()]

    @property
    def label(self) -> str:
        """The parts in one text."""
        return ", ".join(self.parts)

    @property
    def fields(self) -> dict[str, str]:
        """Fields for names of files: all names that are not the values themselves, and the value of `camera`,
        which is otherwise the field of the camera's name."""
        own = {path: name for path, name in self.names.items() if path == "camera"}
        return own | {path: name for path, name in self.names.items() if name != self.values.get(path)}


def variants_of(
    texts: Sequence[str],
    together: bool = False,
    rows: Path | None = None,
    frames: str | None = None,
    of_scene: Frames | None = None,
) -> list[Variant]:
    """The variants that a sweep's options describe.

    Parameters
    ----------
    texts : sequence of str
        `PATH=a,b,c`, `PATH=START:STOP:COUNT` or `PATH=START:STOP:COUNTlog`, the arguments of `-D`. A value
        may be `NAME:VALUE`.
    together : bool
        Combine the first values, the second values, and so on; otherwise every value with every other, the
        last path fastest.
    rows : Path, optional
        CSV: paths in its first line, the values of a variant in each other line. A column `label` has the
        names of the rows.
    frames : str, optional
        `FIRST:LAST` or `FIRST:LAST:STEP`, both ends included; by default the frames of the scene. Every
        variant has every frame, and values may be formulas of `frame` and `time`.
    of_scene : Frames, optional
        The frames of the scene.

    Raises
    ------
    InputError
    """
    # Values of each path, rows of the table, frames; refuse too many.
    numbers = frame_numbers(frames) if frames else of_scene.numbers if of_scene else None
    fps = of_scene.fps if of_scene else FRAMES_PER_SECOND
    axes = [axis_of(text) for text in texts]
    table = _rows(rows) if rows else [_Point({}, {})]
    paths = [axis.path for axis in axes if len(axis.values) > 1]
    for path, count in Counter([*paths, *table[0].values]).items():
        if count > 1:
            raise InputError(f"{path}: has values twice; give all of them in one -D, or in the rows alone")
    for path in (*paths, *table[0].values):
        if path.partition(".")[0] == "frames":
            raise InputError(f"{path}: all variants have the same frames; give it one value with -D")
    lengths = [len(axis.values) for axis in axes]
    count = max(lengths, default=1) if together else math.prod(lengths)
    count *= len(table) * (1 if numbers is None else len(numbers))
    if count > MAX_VARIANTS:
        raise InputError(f"{count} variants are more than {MAX_VARIANTS}; sweep them in parts")

    # All combinations of them.
    grid = list(_together(axes) if together else _grid(axes))
    points = [
        _Point({**row.values, **point.values}, {**row.names, **point.names})
        for row, point in itertools.product(table, grid)
    ]
    differ = [path for path in points[0].names if len({point.names[path] for point in points}) > 1]
    shown = {path: _shown([point.names[path] for point in points]) for path in differ}
    variants = []
    for values, names in ((point.values, point.names) for point in points):
        parts = [
            f"{path.rpartition('.')[2]} {shown[path][names[path]]}"
            if names[path] == values.get(path)
            else names[path]
            for path in differ
        ]
        if numbers is None:
            variants.append(Variant(values, None, names, tuple(parts)))
        for n in numbers or ():
            values_then, names_then = (
                {path: at_frame(path, text, n, fps) for path, text in texts.items()}
                for texts in (values, names)
            )
            variants.append(Variant(values_then, n, names_then, (*parts, f"frame {n}")))
    return variants


def _shown(names: Sequence[str]) -> dict[str, str]:
    """Names as labels show them: numbers are short."""
    numbers = [name for name in dict.fromkeys(names) if number_in(name) is not None]
    return {**{name: name for name in names}, **dict(zip(numbers, short_numbers(numbers), strict=True))}


def short_numbers(values: Sequence[str]) -> tuple[str, ...]:
    """Numbers with as few digits, at least four, as tell them apart; none is longer than it was."""
    for digits in range(4, 17):
        texts = tuple(min(value, f"{float(value):.{digits}g}", key=len) for value in values)
        if len(set(texts)) == len(values):
            return texts
    return tuple(values)


def number_in(text: str) -> float | None:
    """The finite number that a text is; None if it is none."""
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def axis_of(text: str) -> Axis:
    """The path and values that `PATH=VALUES` describes."""
    path, equals, value = text.partition("=")
    if not equals or not path.strip():
        raise InputError(f"-D {text}: write PATH=a,b,c or PATH=START:STOP:COUNT")
    if span := _RANGE.fullmatch(value.strip()):
        numbers = _range(text, span)
        return Axis(path.strip(), numbers, numbers)
    parts = [part.strip() for part in split_at_commas(value)]
    if not all(parts):
        raise InputError(f"-D {text}: a value is empty; write null to take a part away")
    named = [_NAMED.fullmatch(part) for part in parts]
    twice = [name for name, count in Counter(match[1] for match in named if match).items() if count > 1]
    if twice:
        raise InputError(f"-D {short(text)}: two values are called '{twice[0]}'; give each its own name")
    values = tuple(match[2] if match else part for match, part in zip(named, parts, strict=True))
    return Axis(
        path.strip(),
        values,
        tuple(match[1] if match else part for match, part in zip(named, parts, strict=True)),
    )


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


def at_frame(path: str, value: str, frame: int, fps: float = FRAMES_PER_SECOND) -> str:
    """`value` with every formula of `frame` and `time` evaluated; text in quotes and mappings have none.

    A formula without a finite value at this frame is a curve, so that it is a fault of this frame alone.
    """
    text = value.strip()
    if not re.search(r"\b(frame|time)\b", text) or text.startswith(("{", '"', "'")):
        return text
    if text.startswith("[" * MAX_DEPTH):
        raise InputError(f"-D {path}={short(value)}: nested deeper than {MAX_DEPTH} levels")
    if text.startswith("[") and text.endswith("]"):
        return f"[{', '.join(at_frame(path, part, frame, fps) for part in split_at_commas(text[1:-1]))}]"
    try:
        return str(formula_at(text, Moment(frame, frame / fps)))
    except NotFiniteError:
        return f'{{curve: formula, value: "{text}"}}'
    except ValueError as error:
        raise InputError(f"-D {path}={value}: at frame {frame}: {error}") from None


class _Point(Value):
    """The values that some axes or a row take together, and what they are called."""

    values: Mapping[str, str]
    names: Mapping[str, str]


def _point(axes: Sequence[Axis], at: Sequence[int]) -> _Point:
    pairs = list(zip(axes, at, strict=True))
    return _Point(
        {axis.path: axis.values[k] for axis, k in pairs}, {axis.path: axis.names[k] for axis, k in pairs}
    )


def _grid(axes: Sequence[Axis]) -> Iterator[_Point]:
    for at in itertools.product(*(range(len(axis.values)) for axis in axes)):
        yield _point(axes, at)


def _together(axes: Sequence[Axis]) -> Iterator[_Point]:
    count = max((len(axis.values) for axis in axes), default=1)
    odd = [axis for axis in axes if len(axis.values) not in (1, count)]
    if odd:
        raise InputError(
            [f"-D {axis.path}: has {len(axis.values)} values, others {count}; --zip wants as many or one"
             for axis in odd]
        )  # fmt: skip
    for k in range(count):
        yield _point(axes, [k % len(axis.values) for axis in axes])


def _rows(path: Path) -> list[_Point]:
    """The rows of a CSV of overrides; those of a table with a column `label` are called by it."""
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
    rows = [dict(zip(head, (cell.strip() for cell in line), strict=True)) for line in lines[1:]]
    if LABEL not in head:
        return [_Point(row, row) for row in rows]
    labels = [row.pop(LABEL) for row in rows]
    twice = [label for label, count in Counter(labels).items() if count > 1]
    if twice:
        raise InputError(
            [
                f"{path}: {labels.count(label)} rows have the label '{label}'; give each its own"
                for label in twice
            ]
        )
    return [_Point(row, {LABEL: label}) for row, label in zip(rows, labels, strict=True)]
