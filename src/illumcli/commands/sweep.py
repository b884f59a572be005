"""Render the variants of a scene in one process: buffers that no override touches are computed once."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from illumcli.commands.batch import Batch
from illumcli.commands.options import RenderOptions
from illumcli.commands.report import Report
from illumcli.commands.sweep_files import PlannedFiles, SweepFiles, plan_files
from illumcli.commands.sweep_names import default_pattern, refuse_equal_names
from illumcli.commands.sweep_outcome import Outcome, SweepResult, following_due
from illumcli.commands.sweep_works import HELD, SweepWorks, planned_variant
from illumcli.commands.turns import turns
from illumcli.commands.work import Work, unused_keys
from illumcli.errors import IllumError
from illumcli.files.names import check_unique
from illumcli.progress import Progress, no_progress
from illumcli.scene.variants import Variant


def sweep_scene(
    path: Path,
    variants: Sequence[Variant],
    options: RenderOptions | None = None,
    files: SweepFiles | None = None,
    progress: Progress = no_progress,
    written: Callable[[Outcome], None] = lambda outcome: None,
) -> SweepResult:
    """Render every variant and write the files about all of them; `written` is called with each outcome as
    soon as it is known.

    If a variant fails, the others are still rendered. Existing files with the same content are kept, so a
    sweep that was stopped continues where it was.

    Raises
    ------
    IllumError
        At the end if any variant failed. Before anything is rendered if all variants have faults, if one has
        and `options` stop at the first, or if the fault concerns all of them.
    """
    start = time.perf_counter()
    options, files = options or RenderOptions(), files or SweepFiles()
    batch = Batch("variants", len(variants), options.keep_going, lambda text: None)

    # Find faults before the first ray.
    works = SweepWorks(path, replace(options, pattern=options.pattern or default_pattern(variants)))
    outcomes, warnings = _planned(works, variants, batch, written, files.reference)
    if len(batch.failures) == len(variants) or (batch.failures and not options.keep_going):
        batch.finish()
    check_unique([str(image) for outcome in outcomes for image in outcome.paths])
    planned = plan_files(files, outcomes, options.force)

    # Render the images.
    try:
        warnings += _render(works, outcomes, batch, progress, written, planned)
    except BaseException:
        planned.update(outcomes, now=True)
        raise
    seconds = time.perf_counter() - start

    # Write the files about all variants.
    unchanged: list[str] = []
    has_images = any(outcome.report for outcome in outcomes)
    if has_images:
        unchanged = planned.write(outcomes)
    batch.finish(*warnings, *unchanged)
    summary = planned.table.extremes(outcomes) if planned.table else ""
    kept = planned.kept if has_images else ()
    return SweepResult(tuple(outcomes), kept, tuple(warnings), summary, seconds)


def _planned(
    works: SweepWorks,
    variants: Sequence[Variant],
    batch: Batch,
    written: Callable[[Outcome], None],
    reference: str | None,
) -> tuple[list[Outcome], list[str]]:
    """The outcomes with the facts about every variant without a fault, and the warnings about the scene that
    all of them have."""
    assert works.options.pattern is not None
    refuse_equal_names(variants, works.options.pattern)
    warnings: list[str] | None = None

    def planned(outcome: Outcome) -> Outcome:
        nonlocal warnings
        work = works.of(outcome)
        outcome = replace(outcome, planned=planned_variant(work, reference))
        lines = unused_keys(work)
        warnings = lines if warnings is None else [line for line in warnings if line in lines]
        if outcome.number > HELD:
            works.drop(outcome)
        return outcome

    outcomes = [Outcome(number, variant) for number, variant in enumerate(variants, 1)]
    outcomes = [_attempt(outcome, planned, batch, written) for outcome in outcomes]
    return outcomes, warnings or []


def _render(
    works: SweepWorks,
    done: list[Outcome],
    batch: Batch,
    progress: Progress,
    written: Callable[[Outcome], None],
    planned: PlannedFiles,
) -> list[str]:
    """Render every variant, and replace its outcome by one with its report. Returns warnings."""
    following = following_due(done)
    last: Report | None = None

    def images(upcoming: Work | None, outcome: Outcome) -> Outcome:
        _, report = works.worker.run(works.of(outcome), progress, upcoming)
        outcome = replace(outcome, report=report.sharing(last))
        written(outcome)
        return outcome

    # Render one variant after the other; buffers that the next one reads stay in memory.
    for index in turns(batch, lambda index: done[index].claim, progress):
        number, upcoming = following[index], None
        if number is not None:
            with suppress(IllumError):  # reported when it is its turn
                upcoming = works.of(done[number])
        done[index] = _attempt(done[index], partial(images, upcoming), batch, written)
        last = done[index].report or last
        works.drop(done[index])
        planned.update(done)

    # Collect the warnings.
    of_images = [line for outcome in done if outcome.report for line in outcome.report.warnings]
    return [*dict.fromkeys(of_images), *works.worker.finish()]


def _attempt(
    outcome: Outcome, step: Callable[[Outcome], Outcome], batch: Batch, written: Callable[[Outcome], None]
) -> Outcome:
    """The outcome after a step, or with the step's error."""
    with batch.piece(outcome.number - 1):
        return step(outcome)
    failed = replace(outcome, error=batch.failures[outcome.number - 1])
    written(failed)
    return failed
