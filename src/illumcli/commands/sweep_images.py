"""Renders the variants of a sweep."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from illumcli.commands.batch import Batch
from illumcli.commands.report import Report
from illumcli.commands.runner import Pieces, Runner
from illumcli.commands.sweep_files import PlannedFiles
from illumcli.commands.sweep_outcome import Outcome, following_due
from illumcli.commands.sweep_works import SweepWorks
from illumcli.errors import unless_faulty
from illumcli.progress import Progress


def render_variants(
    works: SweepWorks,
    done: list[Outcome],
    batch: Batch,
    runner: Runner,
    written: Callable[[Outcome], None],
    planned: PlannedFiles,
) -> list[str]:
    """Render every variant, and replace its outcome by one with its report. Returns warnings."""
    following = following_due(done)
    last: Report | None = None

    def run(index: int, progress: Progress) -> tuple[list[Path], Report]:
        """Render a variant here; buffers that the next one reads stay in memory."""
        work, number = works.of(index), following[index]
        upcoming = None if number is None else unless_faulty(partial(works.of, number))
        return works.worker.run(work, progress, upcoming)

    def rendered(result: Callable[[], tuple[list[Path], Report]], outcome: Outcome) -> Outcome:
        outcome = replace(outcome, report=result()[1].sharing(last))
        written(outcome)
        return outcome

    kept = (number for number, each in enumerate(done) if each.planned and not each.planned.is_due)
    pieces = Pieces(
        unit=works.unit,
        claim_of=lambda index: done[index].claim,
        run=run,
        kept=frozenset(kept),
    )
    for index, result in runner.results(batch, pieces):
        done[index] = attempt(done[index], partial(rendered, result), batch, written)
        last = done[index].report or last
        works.drop(index)
        planned.update(done)

    # Collect the warnings.
    of_images = [line for outcome in done if outcome.report for line in outcome.report.warnings]
    return [*dict.fromkeys(of_images), *works.worker.finish()]


def attempt(
    outcome: Outcome, step: Callable[[Outcome], Outcome], batch: Batch, written: Callable[[Outcome], None]
) -> Outcome:
    """The outcome after a step, or with the step's error."""
    with batch.piece(outcome.number - 1):
        return step(outcome)
    failed = replace(outcome, error=batch.failures[outcome.number - 1])
    written(failed)
    return failed
