"""The table of a sweep: a line per variant, written while the sweep runs."""

from __future__ import annotations

import csv
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

from illumcli.commands.sweep_measures import Measurer
from illumcli.commands.sweep_outcome import Outcome
from illumcli.files.atomic import write_text
from illumcli.files.outputs import INCOMPLETE
from illumcli.files.reports import sealed_csv
from illumcli.files.seal import is_sealed
from illumcli.scene.variants import LABEL

Cell: TypeAlias = object
INTERVAL = 2.0
"""Seconds between two writings of an unfinished table."""
OF_RUN = ("state", "seconds", "rays", "reused")
"""Columns about the run that rendered a variant."""


class SweepTable:
    """CSV: the values of each variant, its file, content, state, seconds, rays, mean light and its measures
    against a reference.

    An unfinished table is written every few seconds; variants without a row yet are `pending` in it. Rows of
    such a table from an earlier run stay where the image is kept.

    Parameters
    ----------
    path : Path, optional
        None for a table that no file is written of.
    outcomes : sequence of Outcome
        All variants, planned.
    contents : sequence of str
        Hash of what the row of each variant depends on.
    """

    def __init__(
        self, path: Path | None, outcomes: Sequence[Outcome], contents: Sequence[str], measurer: Measurer
    ) -> None:
        self._path, self._contents, self._measurer = path, contents, measurer
        variants = [outcome.variant for outcome in outcomes]
        self._paths = list(dict.fromkeys(name for variant in variants for name in variant.values))
        self._is_named = any(variant.names != variant.values for variant in variants)
        self._columns = [
            *("variant", "frame", *([LABEL] if self._is_named else []), *self._paths, "file", "content"),
            *(*OF_RUN, *measurer.names),
        ]
        self._rows: dict[int, list[Cell]] = {}
        self._earlier = self._rows_of_earlier_run()
        self._written = time.monotonic()

    def update(self, outcomes: Sequence[Outcome], now: bool = False) -> None:
        """Write the rows that are known, `now` or if it was not written for a while."""
        if now or time.monotonic() - self._written > INTERVAL:
            self.write(outcomes)

    def write(self, outcomes: Sequence[Outcome]) -> None:
        """Write the table with the rows that are known."""
        for outcome in outcomes:
            if outcome.number not in self._rows and self._is_known(outcome, outcomes):
                self._rows[outcome.number] = self._row(outcome)
        if self._path is not None:
            rows = [self._rows.get(outcome.number) or self._unknown(outcome) for outcome in outcomes]
            write_text(self._path, sealed_csv(self._columns, rows))
        self._written = time.monotonic()

    def extremes(self, outcomes: Sequence[Outcome]) -> str:
        """The variants that are nearest to their references and farthest from them; empty without them."""
        if "rmse" not in self._columns:
            return ""
        at = self._columns.index("rmse")
        others = [each for each in outcomes if not self._is_reference(each)]
        known = [(self._rows[each.number][at], each) for each in others if each.number in self._rows]
        errors = [(float(str(error)), each) for error, each in known if error != ""]
        if not errors:
            return ""
        best, worst = (choose(errors, key=lambda pair: pair[0]) for choose in (min, max))
        least, largest = (f"{error:.3g} ({each.label})" for error, each in (best, worst))
        return f"{self._path or 'all variants'}: RMSE from {least} to {largest}"

    def state(self, outcome: Outcome) -> str:
        """`rendered`, `kept`, `failed` or `pending`."""
        row = self._rows.get(outcome.number) or self._unknown(outcome)
        return str(row[self._columns.index(OF_RUN[0])])

    def measures(self, outcome: Outcome) -> dict[str, float]:
        """The numbers in the row of a variant after its state: seconds, rays, what was measured."""
        first = self._columns.index(OF_RUN[0]) + 1
        cells = zip(self._columns[first:], self._rows.get(outcome.number, [])[first:], strict=False)
        return {name: float(str(cell)) for name, cell in cells if cell != ""}

    def _is_reference(self, outcome: Outcome) -> bool:
        reference = self._measurer.references.get(outcome.number)
        return reference is not None and reference.number == outcome.number

    def _is_known(self, outcome: Outcome, outcomes: Sequence[Outcome]) -> bool:
        return outcome.report is not None and self._measurer.is_ready(outcome, outcomes)

    def _row(self, outcome: Outcome) -> list[Cell]:
        """The row of a rendered or kept variant."""
        report, content = outcome.report, self._contents[outcome.number - 1]
        assert report is not None
        if not report.written and content in self._earlier:
            return self._earlier[content]
        state = "rendered" if report.written else "kept"
        reused = sum(len(names) for names in report.reused.values())
        of_run = [state, f"{report.total_seconds:.4f}", sum(report.rays.values()), reused]
        measures = self._measurer.of(outcome)
        shown = [f"{measures[name]:.9g}" if name in measures else "" for name in self._measurer.names]
        return [*self._head(outcome, content), *of_run, *shown]

    def _unknown(self, outcome: Outcome) -> list[Cell]:
        """The row of a variant that failed or is not rendered yet."""
        return [*self._head(outcome, INCOMPLETE), "failed" if outcome.error else "pending", "", "", 0]

    def _head(self, outcome: Outcome, content: str) -> list[Cell]:
        label = [outcome.label] if self._is_named else []
        values = [outcome.variant.values.get(path, "") for path in self._paths]
        file = outcome.paths[0] if outcome.paths else ""
        return [outcome.number, outcome.variant.frame, *label, *values, file, content]

    def _rows_of_earlier_run(self) -> dict[str, list[Cell]]:
        """The complete rows of an existing table with the same columns, by content."""
        try:
            if self._path is None or not is_sealed(self._path):
                return {}
            with self._path.open(newline="", encoding="utf-8") as file:
                head, *lines = csv.reader(file)
        except (OSError, ValueError, csv.Error):
            return {}
        if head != [*self._columns, "body"]:
            return {}
        at = head.index("content")
        return {line[at]: list(line[:-1]) for line in lines if line[at] != INCOMPLETE}
