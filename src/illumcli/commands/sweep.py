"""Render the variants of a scene in one process: what no override touches is made once."""

from __future__ import annotations

import csv
import io
import itertools
import math
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from illumcli.commands.batch import Batch
from illumcli.commands.render import Progress, Report, Work, opened_store, prepared, rendered, unused_keys
from illumcli.commands.render_all import Settings
from illumcli.commands.sweep_files import Files, checked
from illumcli.errors import IllumError, InputError, LimitError
from illumcli.files.names import check_unique, fields
from illumcli.geometry.formula import parse as formula
from illumcli.records import Value
from illumcli.render_graph.cached import Memory
from illumcli.scene.load import load
from illumcli.scene.source import MAX_DEPTH, short

MOST = 100_000
"""Variants of one sweep."""
MOST_BYTES = 2**26
"""Of a table of variants."""
LAST_FRAME = 2**53
"""Formulas of `frame` count in doubles."""


class Axis(Value):
    """One path of the scene and the values it takes, as YAML."""

    path: str
    values: tuple[str, ...]


class Variant(Value):
    """One picture of a sweep: the value of every path that varies, and the frame."""

    values: Mapping[str, str]
    frame: int = 0

    @property
    def overrides(self) -> list[str]:
        """As `-D` has them."""
        return [f"{path}={value}" for path, value in self.values.items()]

    @property
    def label(self) -> str:
        """What the contact sheet says of it."""
        return ", ".join(f"{path.rpartition('.')[2]} {value}" for path, value in self.values.items())


@dataclass(slots=True)
class Outcome:
    """What became of a variant."""

    number: int
    """From 1."""
    variant: Variant
    work: Work | None = None
    """None where the scene has a fault with these values."""
    report: Report | None = None
    error: IllumError | None = None

    @property
    def label(self) -> str:
        """What messages call it."""
        return self.variant.label or f"variant {self.number}"

    @property
    def paths(self) -> list[Path]:
        return [target.path for target in self.work.targets] if self.work else []


@dataclass(slots=True)
class Sweep:
    """What happened."""

    outcomes: list[Outcome] = field(default_factory=list)
    kept: list[Path] = field(default_factory=list)
    """Of the files about all variants, those that were the same already."""
    warnings: list[str] = field(default_factory=list)
    seconds: float = 0.0


def run(
    path: Path,
    variants: Sequence[Variant],
    settings: Settings | None = None,
    files: Files | None = None,
    progress: Progress = lambda what, done, of: None,
    written: Callable[[Outcome], None] = lambda outcome: None,
) -> Sweep:
    """Render every variant and write the files about all of them; `written` gets the outcome of each as soon
    as it is known.

    A variant that fails is noted and the others go on. Files that are there with the same content are kept,
    so that a sweep that was stopped goes on where it was.

    Raises
    ------
    IllumError
        At last, where any variant failed; before anything is rendered, where all failed, one did and
        `settings` stop at the first, or what holds for all of them is wrong.
    """
    start = time.perf_counter()
    settings, files = settings or Settings(), files or Files()
    sweep = Sweep([Outcome(number, variant) for number, variant in enumerate(variants, 1)])
    batch = Batch("variants", len(variants), settings.keep_going, lambda said: None)

    # all that can be known before the first ray
    due = _prepared(path, sweep, settings, batch, written)
    if len(batch.failures) == len(variants) or (batch.failures and not settings.keep_going):
        batch.finish()
    check_unique([str(target) for outcome in sweep.outcomes for target in outcome.paths])
    to_write = checked(files, sweep.outcomes, settings.force)

    store = opened_store() if settings.cache else None
    memory = Memory()
    for number in batch.due():
        outcome = sweep.outcomes[number]
        assert outcome.work is not None
        following = next((sweep.outcomes[later].work for later in due if later > number), None)
        with _noted(outcome, batch, written):
            outcome.report = rendered(
                outcome.work, store, memory, settings.threads, settings.force, progress, settings.strict,
                following,
            )  # fmt: skip
            written(outcome)
        memory.retire()
    works = [outcome.work for outcome in sweep.outcomes if outcome.work]
    sweep.warnings += _in_all([unused_keys(work, settings.pattern) for work in works])
    told = [line for outcome in sweep.outcomes if outcome.report for line in outcome.report.warnings]
    sweep.warnings += dict.fromkeys(told)
    if store is not None:
        store.finish()
        sweep.warnings += [store.warning] if store.warning else []
    sweep.seconds = time.perf_counter() - start
    spared: list[str] = []
    if any(outcome.report for outcome in sweep.outcomes):
        spared = to_write.write(sweep.outcomes)
        sweep.kept = list(to_write.kept)
    batch.finish(*sweep.warnings, *spared)
    return sweep


def _prepared(
    path: Path, sweep: Sweep, settings: Settings, batch: Batch, written: Callable[[Outcome], None]
) -> list[int]:
    """Plan every variant that has no fault; the indices of those that are due."""
    variants = [outcome.variant for outcome in sweep.outcomes]
    pattern = settings.pattern or default_pattern(variants)
    refuse_equal_names(variants, pattern)
    due = []
    for index, outcome in enumerate(sweep.outcomes):
        with _noted(outcome, batch, written):
            loaded = load(path, outcome.variant.overrides)
            frame = {"frame": outcome.variant.frame}
            work = prepared(loaded, pattern, settings.only, settings.seed, frame)
            due += [index] if work.due(settings.force) else []
            outcome.work = work
    return due


@contextmanager
def _noted(outcome: Outcome, batch: Batch, written: Callable[[Outcome], None]) -> Iterator[None]:
    """What goes wrong within is the outcome."""
    with batch.piece(outcome.number - 1):
        yield
    if (failure := batch.failures.get(outcome.number - 1)) is not None:
        outcome.error = failure
        written(outcome)


def _in_all(groups: Sequence[Sequence[str]]) -> list[str]:
    """The lines of the first group that stand in every other too."""
    common = set(groups[0]).intersection(*groups) if groups else set()
    return [line for line in groups[0] if line in common] if groups else []


def default_pattern(variants: Sequence[Variant]) -> str:
    """A name that tells the variants apart: by frame where they differ, else by every value that does."""
    if len({variant.frame for variant in variants}) > 1:
        return "{scene}.{frame:04d}.png"
    differ = [
        name for name in variants[0].values if len({variant.values.get(name) for variant in variants}) > 1
    ]
    return "{scene}" + "".join(f"-{{{name}}}" for name in differ) + ".png"


def refuse_equal_names(variants: Sequence[Variant], pattern: str) -> None:
    """Raise InputError where a pattern must give several variants one name; no scene is read for it.

    A scene may still have equal names: those of values that are written differently, of cameras and layers.
    """
    named = fields(pattern)
    if named & {"camera", "layer"} and any(
        path.partition(".")[0] in ("camera", "cameras", "outputs") for path in variants[0].values
    ):
        return
    same: dict[tuple[str | int | None, ...], list[int]] = {}
    used = [path for path in variants[0].values if path in named]
    for number, variant in enumerate(variants, 1):
        values = [variant.values.get(path) for path in used]
        same.setdefault((*values, variant.frame if "frame" in named else None), []).append(number)
    for numbers in same.values():
        if len(numbers) > 1:
            listed = ", ".join(map(str, numbers[:5])) + (", ..." if len(numbers) > 5 else "")
            way = "put a field that tells them apart into the pattern"
            if variants[numbers[0] - 1] == variants[numbers[1] - 1]:
                way = "they are equal; give each value once"
            raise InputError(f"{pattern}: the name of {len(numbers)} variants ({listed}); {way}")


# --- which variants -----------------------------------------------------------------------------------------


def variants_of(
    texts: Sequence[str], together: bool = False, rows: Path | None = None, frames: str | None = None
) -> list[Variant]:
    """The variants that a sweep's options describe.

    Parameters
    ----------
    texts : sequence of str
        `PATH=a,b,c`, `PATH=START:STOP:COUNT` or `PATH=START:STOP:COUNTlog`, as `-D` gives them.
    together : bool
        First values together, second values together, ...; else every value with every other, the last path
        fastest.
    rows : Path, optional
        CSV: paths in its first line, a variant in each other.
    frames : str, optional
        `FIRST:LAST` or `FIRST:LAST:STEP`, both ends included; values may be formulas of `frame`.

    Raises
    ------
    InputError
    """
    numbers = _frames(frames) if frames else None
    axes = [axis_of(text, numbers is not None) for text in texts]
    listed = _rows(rows) if rows else [{}]
    lengths = [len(axis.values) for axis in axes]
    count = max(lengths, default=1) if together else math.prod(lengths)
    count *= len(listed) * (1 if numbers is None else len(numbers))
    if count > MOST:
        raise InputError(f"{count} variants are more than {MOST}; sweep them in parts")
    grid = list(_together(axes) if together else _grid(axes))
    found = []
    for row, own in itertools.product(listed, grid):
        values = {**row, **own}
        if numbers is None:
            found.append(Variant(values))
        else:
            found += [
                Variant({path: at_frame(path, value, n) for path, value in values.items()}, n)
                for n in numbers
            ]
    return found


def axis_of(text: str, moving: bool = False) -> Axis:
    """The path and values that `PATH=VALUES` describes; with `moving` values may be formulas of `frame`."""
    path, equals, said = text.partition("=")
    if not equals or not path.strip():
        raise InputError(f"-D {text}: write PATH=a,b,c or PATH=START:STOP:COUNT")
    if span := _RANGE.fullmatch(said.strip()):
        return Axis(path.strip(), _range(text, span))
    values = tuple(part.strip() for part in split(said))
    if not all(values):
        raise InputError(f"-D {text}: a value is empty; write null to take a part away")
    return Axis(path.strip(), values)


_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE = re.compile(rf"({_NUMBER}):({_NUMBER}):(\d+)(log)?")


def _range(text: str, span: re.Match[str]) -> tuple[str, ...]:
    """COUNT numbers from START to STOP, both included, with equal steps or, for `log`, equal ratios."""
    if len(span[3]) > len(str(MOST)) or not 1 <= int(span[3]) <= MOST:
        raise InputError(f"-D {short(text)}: the count must be from 1 to {MOST}")
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


def split(text: str) -> list[str]:
    """`text` at its commas, those inside brackets and quotes left alone."""
    parts, depth, quote, start = [], 0, "", 0
    for place, letter in enumerate(text):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        elif letter in "([{":
            depth += 1
        elif letter in ")]}":
            depth -= 1
        elif letter == "," and depth == 0:
            parts.append(text[start:place])
            start = place + 1
    return [*parts, text[start:]]


def at_frame(path: str, value: str, frame: int) -> str:
    """`value` with every formula of `frame` in it worked out."""
    inside = value.strip()
    if not re.search(r"\bframe\b", inside):
        return inside
    if inside.startswith("[" * MAX_DEPTH):
        raise InputError(f"-D {path}={short(value)}: nested deeper than {MAX_DEPTH} levels")
    if inside.startswith("[") and inside.endswith("]"):
        return f"[{', '.join(at_frame(path, part, frame) for part in split(inside[1:-1]))}]"
    try:
        number = float(formula(inside, ("frame",)).value(frame))
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
    """The rows of a CSV of overrides."""
    try:
        with path.open("rb") as file:
            text = file.read(MOST_BYTES + 1)
        if len(text) > MOST_BYTES:
            raise LimitError(f"{path}: larger than {MOST_BYTES} bytes; sweep its rows in parts")
        cells = csv.reader(io.StringIO(text.decode("utf-8-sig"), newline=""))
        lines = [line for line in cells if any(cell.strip() for cell in line)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(lines) < 2:
        raise InputError(f"{path}: has no rows; write the paths in its first line and values below")
    head = [cell.strip() for cell in lines[0]]
    problems = [
        f"{path}: row {number} has {len(line)} cells, the first line {len(head)}"
        for number, line in enumerate(lines[1:], 2)
        if len(line) != len(head)
    ]
    if not all(head) or len(set(head)) < len(head):
        problems.append(f"{path}: every column must be named by a path of its own")
    if problems:
        raise InputError(problems)
    return [dict(zip(head, (cell.strip() for cell in line), strict=True)) for line in lines[1:]]
