"""Render the variants of a scene in one process: buffers that no override touches are computed once."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from illumcli.cache.memory import MemoryCache
from illumcli.cache.recorder import Cache
from illumcli.cache.store import open_store
from illumcli.commands.batch import Batch
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import rendered
from illumcli.commands.sweep_files import SweepFiles, plan_files
from illumcli.commands.sweep_names import default_pattern, refuse_equal_names
from illumcli.commands.sweep_outcome import Outcome, SweepResult
from illumcli.commands.work import Work, prepared, unused_keys
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
    """Render every variant and write the files about all of them; `written` gets the outcome of each as soon
    as it is known.

    A variant that fails is noted and the others are rendered. Files that are there with the same content are
    kept, so that a sweep that was stopped goes on where it was.

    Raises
    ------
    IllumError
        At the end, where any variant failed; before anything is rendered, where all failed, one did and
        `options` stop at the first, or what holds for all of them is wrong.
    """
    start = time.perf_counter()
    options, files = options or RenderOptions(), files or SweepFiles()
    batch = Batch("variants", len(variants), options.keep_going, lambda text: None)

    # faults that can be known before the first ray
    outcomes = _prepared(path, variants, options, batch, written)
    if len(batch.failures) == len(variants) or (batch.failures and not options.keep_going):
        batch.finish()
    check_unique([str(image) for outcome in outcomes for image in outcome.paths])
    planned = plan_files(files, outcomes, options.force)

    # the images
    outcomes, warnings = _rendered(outcomes, options, batch, progress, written)
    seconds = time.perf_counter() - start

    # the files about all of them
    unchanged: list[str] = []
    has_images = any(outcome.report for outcome in outcomes)
    if has_images:
        unchanged = planned.write(outcomes)
    batch.finish(*warnings, *unchanged)
    return SweepResult(tuple(outcomes), planned.kept if has_images else (), tuple(warnings), seconds)


def _prepared(
    path: Path,
    variants: Sequence[Variant],
    options: RenderOptions,
    batch: Batch,
    written: Callable[[Outcome], None],
) -> list[Outcome]:
    """Plan every variant that has no fault."""
    pattern = options.pattern or default_pattern(variants)
    refuse_equal_names(variants, pattern)

    def planned(outcome: Outcome) -> Outcome:
        overrides = tuple(outcome.variant.overrides)
        own = replace(options, pattern=pattern, overrides=overrides, audit=False)
        job = RenderJob(path, own, {"frame": outcome.variant.frame})
        work = prepared(job)
        return replace(outcome, work=work, is_due=bool(work.due()))

    outcomes = [Outcome(number, variant) for number, variant in enumerate(variants, 1)]
    return [_attempt(outcome, planned, batch, written) for outcome in outcomes]


def _rendered(
    outcomes: Sequence[Outcome],
    options: RenderOptions,
    batch: Batch,
    progress: Progress,
    written: Callable[[Outcome], None],
) -> tuple[list[Outcome], list[str]]:
    """The outcomes with their reports, and warnings."""
    store, memory = open_store() if options.cache else None, MemoryCache()
    cache = Cache(store, memory)
    done = list(outcomes)

    # one variant after the other; buffers that the next one reads stay in memory
    for index in batch.due():
        following = next((done[k].work for k in range(index + 1, len(done)) if done[k].is_due), None)

        def images(outcome: Outcome, following: Work | None = following) -> Outcome:
            assert outcome.work is not None
            outcome = replace(outcome, report=rendered(outcome.work, cache, progress, following))
            written(outcome)
            return outcome

        done[index] = _attempt(done[index], images, batch, written)
        memory.retire()

    # warnings of the scene hold in all variants, those of images in any
    works = [outcome.work for outcome in done if outcome.work]
    warnings = _in_all([unused_keys(work) for work in works])
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
