"""Render the variants of a scene in one process: buffers that no override touches are computed once."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from illumcli.commands.batch import Batch
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.runner import Here, Runner
from illumcli.commands.sweep_files import SweepFiles, plan_files
from illumcli.commands.sweep_images import render_variants
from illumcli.commands.sweep_names import named, pattern_of
from illumcli.commands.sweep_outcome import Outcome, SweepResult
from illumcli.commands.sweep_planning import plan_variants
from illumcli.commands.sweep_shard import plan_shard, record_shard
from illumcli.commands.sweep_works import SweepWorks
from illumcli.files.names import check_unique
from illumcli.scene.variants import Variant


def sweep_scene(
    path: Path,
    variants: Sequence[Variant],
    options: RenderOptions | None = None,
    files: SweepFiles | None = None,
    runner: Runner = Here(),  # noqa: B008
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
    works = SweepWorks(path, variants, named(path, variants, options))
    plan = plan_variants(works, variants, batch, pattern_of(variants, files.reference or ""))
    outcomes, warnings = plan.outcomes, plan.warnings
    check_unique([str(image) for outcome in outcomes for image in outcome.paths])
    sharding = None if batch.is_lost else plan_shard(works, plan, files)
    if sharding is not None:
        batch.leave_all_but(sharding.own)
    for number in sorted(batch.failures):
        written(outcomes[number])
    if batch.is_lost and sharding is None:
        batch.finish()
    planned = plan_files(files, outcomes, RenderJob(path, works.options))

    # Render the images.
    try:
        warnings += render_variants(works, outcomes, batch, runner, written, planned)
    except BaseException:
        planned.update(outcomes, now=True)
        raise
    seconds = time.perf_counter() - start

    # Write the files about all variants, or the record of a shard of them.
    if sharding is not None:
        summary = record_shard(sharding, outcomes, batch)
        batch.finish(*warnings)
        return SweepResult(tuple(outcomes), (), tuple(warnings), summary, seconds)
    unchanged: list[str] = []
    has_images = any(outcome.report for outcome in outcomes)
    if has_images:
        unchanged = planned.write(outcomes)
    batch.finish(*warnings, *unchanged)
    summary = planned.table.extremes(outcomes) if planned.table else ""
    kept = planned.kept if has_images else ()
    return SweepResult(tuple(outcomes), kept, tuple(warnings), summary, seconds)
