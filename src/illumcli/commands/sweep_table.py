"""The table of a sweep: a line per variant."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.commands.sweep_outcome import Outcome
from illumcli.commands.sweep_reference import Reference, written_colors
from illumcli.files.reports import sealed_csv
from illumcli.film.metrics import difference
from illumcli.scene.variants import LABEL

Cell: TypeAlias = object


def sweep_table(outcomes: Sequence[Outcome], contents: Sequence[str], reference: Reference | None) -> str:
    """CSV: the values of each variant, its file, content, seconds, rays, mean light and, against `reference`,
    RMSE and largest difference of its first file."""
    paths = list(dict.fromkeys(name for outcome in outcomes for name in outcome.variant.values))
    against = None if reference is None else _pixels(reference, outcomes)
    measures = ["mean"] + (["rmse", "largest"] if reference is not None else [])
    named = any(outcome.variant.names != outcome.variant.values for outcome in outcomes)
    ahead = ["variant", "frame", *([LABEL] if named else []), *paths]
    columns = [*ahead, "file", "content", "state", "seconds", "rays", "reused", *measures]
    rows = [
        [*_row(outcome, content, paths, named), *_measures(outcome, against)]
        for outcome, content in zip(outcomes, contents, strict=True)
    ]
    return sealed_csv(columns, rows)


def _pixels(reference: Reference, outcomes: Sequence[Outcome]) -> NDArray[np.float32] | None:
    files = [outcome.paths[0] for outcome in outcomes if outcome.number == reference.number]
    return written_colors(files[0])[0] if files else reference.pixels


def _row(outcome: Outcome, content: str, paths: Sequence[str], named: bool) -> list[Cell]:
    """Values of a variant, its file and state, and the time and rays it took."""
    report = outcome.report
    file = outcome.paths[0] if outcome.paths else ""
    values = [outcome.variant.values.get(path, "") for path in paths]
    label = [outcome.label] if named else []
    row = [outcome.number, outcome.variant.frame, *label, *values, file, content]
    if report is None:
        return [*row, "failed", "", "", 0]
    reused = sum(len(names) for names in report.reused.values())
    state = "rendered" if report.written else "kept"
    return [*row, state, f"{report.total_seconds:.4f}", sum(report.rays.values()), reused]


def _measures(outcome: Outcome, against: NDArray[np.float32] | None) -> list[Cell]:
    """Mean of a variant's first image, and its difference from the reference."""
    if outcome.report is None:
        return []
    pixels, _ = written_colors(outcome.paths[0])
    mean = f"{pixels.mean(dtype=np.float64):.9g}"
    if against is None:
        return [mean]
    error = difference(against, pixels)
    return [mean, f"{error.rmse:.9g}", f"{error.largest:.9g}"]
