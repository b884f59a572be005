"""The numerical stability suite: scenes, rays, models and meshes at the limits, and what came of them."""

from __future__ import annotations

import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from illumcli.errors import ThresholdError
from illumcli.records import Value
from illumcli.stress import meshes, models, rays, scale, scenes
from illumcli.stress.outcome import Row, Sandbox

__all__ = ["Result", "as_data", "as_table", "check", "run"]

Progress = Callable[[str, int, int], None]


class Result(Value):
    """Every row, and what was looked at."""

    rows: tuple[Row, ...]
    pictures: int
    pixels: int
    values: int
    not_finite: int
    negative: int
    seconds: float

    @property
    def failed(self) -> list[str]:
        return [row.case for row in self.rows if not row.passed]


def run(quick: bool = False, progress: Progress = lambda what, done, of: None) -> Result:
    """The whole suite, or with `quick` a small picture of every case. Nothing is kept between runs."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="illum-stress-") as folder, warnings.catch_warnings():
        warnings.simplefilter("error")  # an overflow that numpy notices is a finding
        room = Sandbox(Path(folder))
        parts: dict[str, Callable[[], list[Row]]] = {
            "scenes": lambda: scenes.rows(room, quick),
            "scale": lambda: scale.rows(room, quick),
            "rays": lambda: rays.check_rows(room, quick),
            "models": lambda: models.rows(quick),
            "meshes": lambda: meshes.rows(room, quick),
        }
        found: list[Row] = []
        for number, (name, part) in enumerate(parts.items()):
            progress(name, number, len(parts))
            found += part()
        progress("done", len(parts), len(parts))
    return Result(
        tuple(found), room.pictures, room.pixels, room.values, room.not_finite, room.negative,
        time.perf_counter() - start,
    )  # fmt: skip


def check(result: Result) -> None:
    """Raise ThresholdError where a case failed."""
    if result.failed:
        raise ThresholdError(f"failed: {', '.join(result.failed)}")


def as_table(result: Result) -> str:
    """One line per case, and the totals."""
    lines = [("case", "what is checked", "worst", "verdict")]
    lines += [
        (row.case, row.check, _short(row.worst), "ok" if row.passed else "FAILED") for row in result.rows
    ]
    widths = [max(len(line[column]) for line in lines) for column in range(3)]
    table = [
        "  ".join([*(word.ljust(width) for word, width in zip(line, widths, strict=False)), line[3]])
        for line in lines
    ]
    return "\n".join([*table, "", summary(result)])


def summary(result: Result) -> str:
    """The totals in a line."""
    passed = len(result.rows) - len(result.failed)
    seen = f"{result.pictures:,} pictures, {result.pixels:,} pixels, {result.values:,} values"
    wrong = f"{result.not_finite} NaN or infinite, {result.negative} below 0"
    return f"{passed} of {len(result.rows)} cases passed; {seen}: {wrong}; {result.seconds:.0f} s"


def as_data(result: Result) -> dict[str, Any]:
    """The same for JSON."""
    data = {name: value for name, value in vars(result).items() if name != "rows"}
    cases = [vars(row) for row in result.rows]
    return {**data, "failed": result.failed, "cases": cases}


def _short(text: str, most: int = 90) -> str:
    line = " ".join(text.split())
    return line if len(line) <= most else f"{line[: most - 1]}…"
