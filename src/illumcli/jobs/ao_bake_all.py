"""Bake several inputs: what is wrong with any of them is told before the first ray, the others are done."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from illumcli.files.atomic import write_text
from illumcli.files.names import check_unique, expand
from illumcli.files.outputs import INCOMPLETE, is_kept, refresh, refuse_suffix
from illumcli.jobs.ao_bake import Report, Settings, Work, baked, prepared
from illumcli.jobs.batch import Batch, Tell
from illumcli.jobs.render import Progress, report_text
from illumcli.plan.keys import digest
from illumcli.records import Value


class Asked(Value):
    """What all inputs are baked with, and how."""

    settings: Settings
    patterns: tuple[str, ...]
    """Of the outputs' names; `{scene}` is the input's name without its suffix."""
    overrides: tuple[str, ...] = ()
    threads: int | None = None
    force: bool = False
    strict: bool = False
    keep_going: bool = True

    def outputs(self, path: Path) -> list[Path]:
        """The files of one input."""
        return [Path(expand(pattern, {"scene": path.stem})) for pattern in self.patterns]

    def prepared(self, path: Path) -> Work:
        """An input whose meshes are read."""
        return prepared(path, self.outputs(path), self.settings, self.overrides, self.force, self.strict)


def run(
    inputs: Sequence[Path],
    asked: Asked,
    report: Path | None,
    progress: Progress,
    written: Callable[[Path, list[Path], Report], None],
    tell: Tell,
) -> bool:
    """Bake every input; is the report kept, since it holds the same as it would?

    `written` gets each input that is done, its files and report, `tell` the fault of each that is not.

    Raises
    ------
    IllumError
        At last, where any input failed; at once, where files have one name or the report cannot be written.
    """
    batch = Batch("inputs", len(inputs), asked.keep_going, tell)
    entries: list[dict[str, Any]] = [{"input": str(path), "content": INCOMPLETE} for path in inputs]
    check_unique([str(each) for path in dict.fromkeys(inputs) for each in asked.outputs(path)])

    # all that can be known before the first ray; the meshes of one input alone are held meanwhile
    lone: Work | None = None
    for number in batch.due():
        with batch.piece(number):
            work = asked.prepared(inputs[number])
            entries[number]["content"] = digest((work.content, [str(each) for each in work.outputs]))
            lone = work if len(inputs) == 1 else None
            del work
    report_is_kept = False
    if report is not None:
        refuse_suffix(report, "a report", ".json")
        report_is_kept = is_kept(report, [entry["content"] for entry in entries], asked.force)

    for number in batch.due():
        with batch.piece(number):
            paths, done = baked(
                lone or asked.prepared(inputs[number]), asked.settings, asked.threads, progress
            )
            entries[number] = done.as_data() | {"content": entries[number]["content"]}
            written(inputs[number], paths, done)
    for number, failure in batch.failures.items():
        entries[number] |= {"content": INCOMPLETE, "error": str(failure)}
    if report is not None and report_is_kept:
        refresh(report)
    elif report is not None:
        write_text(report, report_text(entries))
    batch.finish()
    return report_is_kept
