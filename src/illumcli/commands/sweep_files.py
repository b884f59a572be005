"""The files about all variants of a sweep: contact sheet, table, report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from illumcli.cache.fingerprint import digest
from illumcli.commands.options import RenderJob
from illumcli.commands.sweep_html import html_contents, is_html_kept, write_html
from illumcli.commands.sweep_measures import Measurer
from illumcli.commands.sweep_outcome import Outcome
from illumcli.commands.sweep_reference import Reference, references_of
from illumcli.commands.sweep_sheet import refuse_sheet, sheet_contents, write_sheet
from illumcli.commands.sweep_table import SweepTable
from illumcli.files.outputs import INCOMPLETE, is_complete, is_kept, refresh, refuse_suffix
from illumcli.files.reports import report_contents, sealed_json
from illumcli.html_report.entries import PAGE
from illumcli.records import Record, Value


class SweepFiles(Value):
    """The files to write about all variants."""

    sheet: Path | None = None
    columns: int | None = None
    """Of the sheet; by default the values of the path that varies fastest, if they make a grid."""
    table: Path | None = None
    report: Path | None = None
    html: Path | None = None
    """Folder of a report for a browser."""
    reference: str | None = None
    """What measures are relative to: a variant's number, a file, or a pattern of files."""
    flips: bool = False
    """True to measure FLIP, too."""


class PlannedFiles(Record):
    """The files to write, with the hashes of their contents; the table unless all that shows it is kept."""

    files: SweepFiles
    job: RenderJob
    """The scene, and the options that all variants have."""
    table: SweepTable | None
    references: Mapping[int, Reference]
    contents: dict[int, str]
    """Number of a variant -> hash of its content; variants that failed have none."""
    kept: tuple[Path, ...]

    def update(self, outcomes: Sequence[Outcome], now: bool = False) -> None:
        """Write the unfinished table, `now` or if it was not written for a while."""
        if self.table is not None:
            self.table.update(outcomes, now)

    def write(self, outcomes: Sequence[Outcome]) -> list[str]:
        """Write the files that are not kept. Returns a message for each that failures leave unchanged."""
        from illumcli.files.atomic import write_text

        files, unchanged = self.files, []
        contents = [self._content(outcome) for outcome in outcomes]
        if self.table is not None:
            self.table.write(outcomes)
        if files.html is not None and files.html / PAGE not in self.kept:
            assert self.table is not None
            write_html(files.html, html_contents(self.job, outcomes, contents, self.table, self.references))
        if files.sheet is not None and files.sheet not in self.kept:
            content = content_of_all([*contents, str(files.columns)])
            if content == INCOMPLETE and is_complete(files.sheet, sheet_contents):
                unchanged.append(f"{files.sheet}: stays as it is; a new one would lack pictures")
            else:
                write_sheet(files.sheet, outcomes, files.columns, content)
        if files.report is not None and files.report not in self.kept:
            write_text(files.report, sealed_json(report_data(outcomes, contents), in_a_list=True))
        for path in self.kept:
            refresh(path)
        return unchanged

    def _content(self, outcome: Outcome) -> str:
        return INCOMPLETE if outcome.report is None else self.contents[outcome.number]


def plan_files(files: SweepFiles, outcomes: Sequence[Outcome], job: RenderJob) -> PlannedFiles:
    """Plan the files, and refuse those that are certain to fail; nothing is rendered yet.

    Raises
    ------
    InputError
        The reference does not exist, is no image or does not fit; a file has an unknown suffix.
    OutputError
        A file cannot be written; a different one exists and `job` has not `force`.
    LimitError
        The contact sheet does not fit into memory.
    """
    # Refuse wrong suffixes, and a sheet that is too large.
    for path, what, suffix in ((files.table, "a table", ".csv"), (files.report, "a report", ".json")):
        if path is not None:
            refuse_suffix(path, what, suffix)
    if files.sheet is not None:
        refuse_sheet(files.sheet, outcomes, files.columns)

    # Hash the contents of each file, and find the files that exist already.
    references = {} if files.reference is None else references_of(files.reference, outcomes)
    contents = {
        outcome.number: digest(
            (
                dict(outcome.variant.values),
                dict(outcome.variant.names),
                outcome.variant.frame,
                [str(path) for path in outcome.paths],
                outcome.planned.content,
                references[outcome.number].content if references else None,
                files.flips,
            )
        )
        for outcome in outcomes
        if outcome.planned is not None
    }
    force = job.options.force
    each = [contents.get(outcome.number, INCOMPLETE) for outcome in outcomes]
    held = (
        (files.table, each, report_contents),
        (files.sheet, [content_of_all([*each, str(files.columns)])], sheet_contents),
        (files.report, each, report_contents),
    )
    kept = tuple(path for path, named, read in held if path is not None and is_kept(path, named, read, force))
    if files.html is not None and is_html_kept(files.html, each, force):
        kept += (files.html / PAGE,)

    # The table is measured if it or a report that shows it has to be written, which no shard does.
    table, shown = None, (files.table, files.html and files.html / PAGE)
    if job.options.shard is None and any(path is not None and path not in kept for path in shown):
        table = SweepTable(files.table, outcomes, each, Measurer(references, files.flips))
    return PlannedFiles(files, job, table, references, contents, kept)


def content_of_all(contents: Sequence[str]) -> str:
    """The content of a file about all variants; incomplete if one of them failed."""
    return INCOMPLETE if INCOMPLETE in contents else digest(contents)


def report_data(outcomes: Sequence[Outcome], contents: Sequence[str]) -> list[dict[str, Any]]:
    """Every variant's report, with its values."""
    return [
        {"values": dict(outcome.variant.values), "frame": outcome.variant.frame, "content": content}
        | (outcome.report.as_data() if outcome.report else {"error": str(outcome.error)})
        for outcome, content in zip(outcomes, contents, strict=True)
    ]
