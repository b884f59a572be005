"""Runs the numerical stability suite and formats its results."""

from __future__ import annotations

import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from illumcli.errors import ThresholdError
from illumcli.progress import Progress, no_progress
from illumcli.records import Value
from illumcli.stress.meshes import check_meshes
from illumcli.stress.models import check_models
from illumcli.stress.rays import check_rays
from illumcli.stress.sandbox import CheckResult, Sandbox
from illumcli.stress.scale import check_scale
from illumcli.stress.scenes import check_scenes
from illumcli.tables import aligned


class SuiteResult(Value):
    """The results of all checks, and the amount of values that were checked."""

    rows: tuple[CheckResult, ...]
    pictures: int
    pixels: int
    values: int
    not_finite: int
    negative: int
    seconds: float

    @property
    def failed(self) -> list[str]:
        """The names of the failed cases."""
        return [row.case for row in self.rows if not row.passed]

    def as_data(self) -> dict[str, Any]:
        """The result for JSON output."""
        data = {name: value for name, value in vars(self).items() if name != "rows"}
        return {**data, "failed": self.failed, "cases": [vars(row) for row in self.rows]}


def run_suite(quick: bool = False, progress: Progress = no_progress) -> SuiteResult:
    """Run all checks, with `quick` on small images. Nothing is cached between runs."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="illum-stress-") as folder, warnings.catch_warnings():
        warnings.simplefilter("error")  # numpy's warnings, such as of an overflow, are findings
        sandbox = Sandbox(Path(folder))
        parts: dict[str, Callable[[], list[CheckResult]]] = {
            "scenes": lambda: check_scenes(sandbox, quick),
            "scale": lambda: check_scale(sandbox, quick),
            "rays": lambda: check_rays(sandbox, quick),
            "models": lambda: check_models(quick),
            "meshes": lambda: check_meshes(sandbox, quick),
        }
        results: list[CheckResult] = []
        for number, (name, part) in enumerate(parts.items()):
            progress(name, number, len(parts))
            results += part()
        progress("done", len(parts), len(parts))
    return SuiteResult(
        tuple(results), sandbox.pictures, sandbox.pixels, sandbox.values, sandbox.not_finite,
        sandbox.negative, time.perf_counter() - start,
    )  # fmt: skip


def refuse_failures(result: SuiteResult) -> None:
    """Raise ThresholdError if a case failed."""
    if result.failed:
        raise ThresholdError(f"failed: {', '.join(result.failed)}")


def suite_table(result: SuiteResult) -> str:
    """A line for each case, and the totals."""
    lines = [("case", "what is checked", "worst", "verdict")]
    lines += [
        (row.case, row.check, _short(row.worst), "ok" if row.passed else "FAILED") for row in result.rows
    ]
    return "\n".join([*aligned(lines), "", summary(result)])


def summary(result: SuiteResult) -> str:
    """The totals in one line."""
    passed = len(result.rows) - len(result.failed)
    seen = f"{result.pictures:,} pictures, {result.pixels:,} pixels, {result.values:,} values"
    wrong = f"{result.not_finite} NaN or infinite, {result.negative} below 0"
    return f"{passed} of {len(result.rows)} cases passed; {seen}: {wrong}; {result.seconds:.0f} s"


def _short(text: str, most: int = 90) -> str:
    line = " ".join(text.split())
    return line if len(line) <= most else f"{line[: most - 1]}…"
