"""Render the variants of a scene in one process: what no override touches is made once."""

from __future__ import annotations

import csv
import io
import itertools
import json
import math
import re
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import IllumError, InputError
from illumcli.files.names import check_unique
from illumcli.geometry.formula import parse as formula
from illumcli.jobs.render import (
    Progress,
    Report,
    Work,
    is_kept,
    opened_store,
    prepared,
    rendered,
    unused_keys,
)
from illumcli.plan.artifacts import Memory
from illumcli.records import Value
from illumcli.scene.load import load

MOST = 100_000
"""Variants of one sweep."""


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

    variant: Variant
    work: Work
    report: Report | None = None
    error: IllumError | None = None

    @property
    def paths(self) -> list[Path]:
        return [target.path for target in self.work.targets]


@dataclass(slots=True)
class Sweep:
    """What happened."""

    outcomes: list[Outcome] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    seconds: float = 0.0


def run(
    path: Path,
    variants: Sequence[Variant],
    pattern: str | None = None,
    only: Sequence[str] = (),
    seed: int | None = None,
    threads: int | None = None,
    force: bool = False,
    cache: bool = True,
    progress: Progress = lambda what, done, of: None,
    written: Any = lambda outcome: None,
    strict: bool = False,
) -> Sweep:
    """Render every variant; `written` is called with the outcome of each as soon as it is known.

    `strict` refuses variants whose meshes or textures need repairs.

    A variant that fails is noted and the others go on. Files that are there with the same content are kept,
    so that a sweep that was stopped goes on where it was.

    Raises
    ------
    InputError, LimitError, OutputError
        Before anything is rendered, for all variants at once.
    """
    start = time.perf_counter()
    works = _prepared(path, variants, pattern, only, seed)
    due = [any(not is_kept(target, force) for target in work.targets) for work in works]
    store = opened_store() if cache else None
    memory = Memory()
    sweep = Sweep()
    for number, (variant, work) in enumerate(zip(variants, works, strict=True)):
        outcome = Outcome(variant, work)
        following = next((later for later in range(number + 1, len(works)) if due[later]), None)
        try:
            after = None if following is None else works[following]
            outcome.report = rendered(work, store, memory, threads, force, progress, strict, after)
        except IllumError as error:
            outcome.error = error
        memory.retire()
        sweep.outcomes.append(outcome)
        written(outcome)
    sweep.warnings += _in_all([unused_keys(work, pattern) for work in works])
    if store is not None:
        store.finish()
        sweep.warnings += [store.warning] if store.warning else []
    sweep.seconds = time.perf_counter() - start
    return sweep


def _prepared(
    path: Path, variants: Sequence[Variant], pattern: str | None, only: Sequence[str], seed: int | None
) -> list[Work]:
    """Every variant's plan and files; all their problems at once."""
    works: list[Work] = []
    problems: dict[str, None] = {}
    for variant in variants:
        try:
            loaded = load(path, variant.overrides)
            own = pattern or default_pattern(variants)
            works.append(prepared(loaded, own, only, seed, {"frame": variant.frame}))
        except InputError as error:
            problems |= dict.fromkeys(error.problems)
    if problems:
        raise InputError(problems)
    check_unique([str(target.path) for work in works for target in work.targets])
    return works


def _in_all(groups: Sequence[Sequence[str]]) -> list[str]:
    """The lines of the first group that stand in every other too."""
    common = set(groups[0]).intersection(*groups) if groups else set()
    return [line for line in groups[0] if line in common] if groups else []


def failed(sweep: Sweep) -> IllumError | None:
    """What went wrong with the variants that failed, with the first one's exit code; None where none did."""
    wrong = [(outcome, outcome.error) for outcome in sweep.outcomes if outcome.error is not None]
    if not wrong:
        return None
    lines = [f"{outcome.variant.label or 'variant'}: {error}" for outcome, error in wrong]
    whole = IllumError("\n".join([*lines, f"{len(wrong)} of {len(sweep.outcomes)} variants failed"]))
    whole.exit_code = wrong[0][1].exit_code
    return whole


def default_pattern(variants: Sequence[Variant]) -> str:
    """A name that tells the variants apart: by frame where they differ, else by every value that does."""
    if len({variant.frame for variant in variants}) > 1:
        return "{scene}.{frame:04d}.png"
    differ = [
        name for name in variants[0].values if len({variant.values.get(name) for variant in variants}) > 1
    ]
    return "{scene}" + "".join(f"-{{{name}}}" for name in differ) + ".png"


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
    grid = list(_together(axes) if together else _grid(axes))
    count = len(listed) * len(grid) * len(numbers or (0,))
    if count > MOST:
        raise InputError(f"{count} variants are more than {MOST}; sweep them in parts")
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
    first, last, count = float(span[1]), float(span[2]), int(span[3])
    if not 1 <= count <= MOST:
        raise InputError(f"-D {text}: the count must be from 1 to {MOST}")
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
    span = re.fullmatch(r"(\d+):(\d+)(?::(\d+))?", text)
    if not span or int(span[2]) < int(span[1]) or span[3] == "0":
        raise InputError(f"--frames {text}: write FIRST:LAST or FIRST:LAST:STEP, as in 0:119")
    return range(int(span[1]), int(span[2]) + 1, int(span[3] or 1))


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
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
    lines = [line for line in csv.reader(io.StringIO(text)) if any(cell.strip() for cell in line)]
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


# --- what comes of them -----------------------------------------------------------------------------------


def table(sweep: Sweep, reference: str | None = None) -> str:
    """CSV: a line per variant with its values, file, seconds, rays, mean light and, against `reference` (a
    variant's number from 1, or an image file), RMSE and largest difference of its first file."""
    from illumcli.film.metrics import difference

    paths = list(dict.fromkeys(name for outcome in sweep.outcomes for name in outcome.variant.values))
    against = None if reference is None else _reference(sweep, reference)
    measures = ["mean"] + (["rmse", "largest"] if against is not None else [])
    out = io.StringIO()
    lines = csv.writer(out, lineterminator="\n")
    lines.writerow(["variant", "frame", *paths, "file", "state", "seconds", "rays", "reused", *measures])
    for number, outcome in enumerate(sweep.outcomes, 1):
        report = outcome.report
        state = "failed" if report is None else "rendered" if report.written else "kept"
        reused = sum(len(names) for names in report.reused.values()) if report else 0
        row: list[Any] = [number, outcome.variant.frame, *(outcome.variant.values.get(p, "") for p in paths)]
        row += [outcome.paths[0], state, f"{report.total_seconds:.4f}" if report else "",
                sum(report.rays.values()) if report else "", reused]  # fmt: skip
        if report is not None:
            picture = colors(outcome.paths[0])
            row.append(f"{picture.mean(dtype=np.float64):.9g}")
            if against is not None:
                if against.shape != picture.shape:
                    raise InputError(f"{outcome.paths[0]}: is of another size than the reference")
                apart = difference(against, picture)
                row += [f"{apart.rmse:.9g}", f"{apart.largest:.9g}"]
        lines.writerow(row)
    return out.getvalue()


def write_table(path: Path, sweep: Sweep, reference: str | None = None) -> None:
    """Write the table."""
    from illumcli.files.atomic import write_text

    write_text(path, table(sweep, reference))


def _reference(sweep: Sweep, reference: str) -> NDArray[np.float32]:
    if not reference.isdigit():
        return colors(Path(reference))
    if not 1 <= int(reference) <= len(sweep.outcomes):
        raise InputError(f"--reference {reference}: there are variants 1 to {len(sweep.outcomes)}")
    return colors(sweep.outcomes[int(reference) - 1].paths[0])


def colors(path: Path) -> NDArray[np.float32]:
    """(H, W, 3) or (H, W, 1) an image's R G B, or its first channel where it has none."""
    from illumcli.files.images import read_image

    found = read_image(path).channels
    names = ("R", "G", "B") if {"R", "G", "B"} <= found.keys() else (next(iter(found)),)
    return np.stack([found[name] for name in names], axis=-1)


def sheet(sweep: Sweep, path: Path) -> None:
    """Write a contact sheet: the first picture of every variant, with its values below."""
    from illumcli.files.images import write_sheet
    from illumcli.film.encode import picture

    def shown(outcome: Outcome) -> NDArray[Any]:
        file = outcome.paths[0]
        exposure = outcome.work.scene.film.exposure
        light = colors(file)
        if file.suffix.lower() == ".png":
            return np.rint(light * 255).astype(np.uint8)
        return picture(light, exposure, 8, str(file))

    done = [outcome for outcome in sweep.outcomes if outcome.report is not None]
    if done:
        labels = [outcome.variant.label or f"frame {outcome.variant.frame}" for outcome in done]
        write_sheet(path, map(shown, done), labels)


def report_data(sweep: Sweep) -> list[dict[str, Any]]:
    """Every variant's report, with its values."""
    return [
        {"values": dict(outcome.variant.values), "frame": outcome.variant.frame}
        | (outcome.report.as_data() if outcome.report else {"error": str(outcome.error)})
        for outcome in sweep.outcomes
    ]


def write_report(path: Path, sweep: Sweep) -> None:
    """Write all reports as JSON."""
    from illumcli.files.atomic import write_text

    write_text(path, json.dumps(report_data(sweep), indent=1) + "\n")
