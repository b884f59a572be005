"""Render the variants of a scene in one process: buffers that no override touches are computed once."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from illumcli.commands.batch import Batch
from illumcli.commands.render import Work, opened_store, prepared, rendered, unused_keys
from illumcli.commands.render_all import Settings
from illumcli.commands.sweep_files import SweepFiles, plan_files
from illumcli.commands.sweep_names import default_pattern, refuse_equal_names
from illumcli.commands.sweep_outcome import Outcome, SweepResult
from illumcli.files.names import check_unique
from illumcli.progress import Progress, no_progress
from illumcli.render_graph.cached import Memory
from illumcli.scene.load import load
from illumcli.scene.variants import Variant


def sweep_scene(
    path: Path,
    variants: Sequence[Variant],
    settings: Settings | None = None,
    files: SweepFiles | None = None,
    progress: Progress = no_progress,
    written: Callable[[Outcome], None] = lambda outcome: None,
) -> SweepResult:
    """Render every variant and write the files about all of them; `written` gets the outcome of each as soon
    as it is known.

    A variant that fails is noted and the others are rendered. Files that are there with the same content are
    kept, so that a sweep that was stopped goes on where it was.

    Raises
    ------
    IllumError
        At the end, where any variant failed; before anything is rendered, where all failed, one did and
        `settings` stop at the first, or what holds for all of them is wrong.
    """
    start = time.perf_counter()
    settings, files = settings or Settings(), files or SweepFiles()
    batch = Batch("variants", len(variants), settings.keep_going, lambda text: None)

    # faults that can be known before the first ray
    outcomes = _prepared(path, variants, settings, batch, written)
    if len(batch.failures) == len(variants) or (batch.failures and not settings.keep_going):
        batch.finish()
    check_unique([str(image) for outcome in outcomes for image in outcome.paths])
    planned = plan_files(files, outcomes, settings.force)

    # the images
    outcomes, warnings = _rendered(outcomes, settings, batch, progress, written)
    seconds = time.perf_counter() - start

    # the files about all of them
    spared: list[str] = []
    has_images = any(outcome.report for outcome in outcomes)
    if has_images:
        spared = planned.write(outcomes)
    batch.finish(*warnings, *spared)
    return SweepResult(tuple(outcomes), planned.kept if has_images else (), tuple(warnings), seconds)


def _prepared(
    path: Path,
    variants: Sequence[Variant],
    settings: Settings,
    batch: Batch,
    written: Callable[[Outcome], None],
) -> list[Outcome]:
    """Plan every variant that has no fault."""
    pattern = settings.pattern or default_pattern(variants)
    refuse_equal_names(variants, pattern)

    def planned(outcome: Outcome) -> Outcome:
        loaded = load(path, outcome.variant.overrides)
        fields = {"frame": outcome.variant.frame}
        work = prepared(loaded, pattern, settings.only, settings.seed, fields)
        return replace(outcome, work=work, is_due=bool(work.due(settings.force)))

    outcomes = [Outcome(number, variant) for number, variant in enumerate(variants, 1)]
    return [_attempt(outcome, planned, batch, written) for outcome in outcomes]


def _rendered(
    outcomes: Sequence[Outcome],
    settings: Settings,
    batch: Batch,
    progress: Progress,
    written: Callable[[Outcome], None],
) -> tuple[list[Outcome], list[str]]:
    """The outcomes with their reports, and warnings."""
    store = opened_store() if settings.cache else None
    memory = Memory()
    done = list(outcomes)

    # one variant after the other; buffers that the next one reads stay in memory
    for index in batch.due():
        following = next((done[k].work for k in range(index + 1, len(done)) if done[k].is_due), None)

        def images(outcome: Outcome, following: Work | None = following) -> Outcome:
            assert outcome.work is not None
            report = rendered(
                outcome.work, store, memory, settings.threads, settings.force, progress, settings.strict,
                following,
            )  # fmt: skip
            outcome = replace(outcome, report=report)
            written(outcome)
            return outcome

        done[index] = _attempt(done[index], images, batch, written)
        memory.retire()

    # warnings of the scene hold in all variants, those of images in any
    works = [outcome.work for outcome in done if outcome.work]
    warnings = _in_all([unused_keys(work, settings.pattern) for work in works])
    of_images = [line for outcome in done if outcome.report for line in outcome.report.warnings]
    warnings += dict.fromkeys(of_images)
    if store is not None:
        store.finish()
        warnings += [store.warning] if store.warning else []
    return done, warnings


def _attempt(
    outcome: Outcome,
    step: Callable[[Outcome], Outcome],
    batch: Batch,
    written: Callable[[Outcome], None],
) -> Outcome:
    """The outcome after a step; a fault of the step is noted."""
    with batch.piece(outcome.number - 1):
        return step(outcome)
    failed = replace(outcome, error=batch.failures[outcome.number - 1])
    written(failed)
    return failed


def _in_all(groups: Sequence[Sequence[str]]) -> list[str]:
    """The lines of the first group that are in every other too."""
    common = set(groups[0]).intersection(*groups) if groups else set()
    return [line for line in groups[0] if line in common] if groups else []
