"""Render several scenes: faults are reported before the first ray, and the other scenes are rendered."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from illumcli.cache.fingerprint import digest
from illumcli.cache.memory import MemoryCache
from illumcli.cache.store import open_store
from illumcli.commands.batch import Batch, BatchReport, Tell
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_prepared
from illumcli.commands.report import Report
from illumcli.commands.work import Work, prepared
from illumcli.files.names import check_unique
from illumcli.progress import Progress
from illumcli.records import Value

if TYPE_CHECKING:
    from illumcli.accuracy.reconstructed_target import ReconstructedChoice
    from illumcli.accuracy.target import SamplingChoice


class Rendered(Value):
    """A rendered scene."""

    scene: Path
    paths: list[Path]
    report: Report
    counts: tuple[str, ...] = ()
    """The overrides that `target_error` chose."""


def render_scenes(
    scenes: Sequence[Path],
    options: RenderOptions,
    report: Path | None,
    progress: Progress,
    written: Callable[[Rendered], None],
    tell: Tell,
) -> bool:
    """Render every scene. True if the report is kept because it would be the same.

    `written` is called with each rendered scene, `tell` with the error of each that failed.

    Raises
    ------
    IllumError
        At the end if any scene failed; at once if files have equal names or the report cannot be written.
    """
    batch = Batch("scenes", len(scenes), options.keep_going, tell)
    works: dict[int, Work] = {}
    entries = BatchReport(report, [{"scene": str(scene)} for scene in scenes])

    # Find faults before the first ray.
    for number in batch.due():
        with batch.piece(number):
            works[number] = work = prepared(RenderJob(scenes[number], options))
            work.due()
            names = [str(target.path) for target in work.targets]
            entries.plan(number, digest((work.content, names, options.target_error)))
    check_unique([str(path) for path, _ in _files(works)])
    entries.look(options.force)

    # Render.
    for number in batch.due():
        with batch.piece(number):
            done = _rendered(works.pop(number), progress)
            if report is not None:
                entries.add(number, done.report.as_data())
            written(done)
    return entries.finish(batch)


def _files(works: dict[int, Work]) -> list[tuple[Path, str]]:
    """Every file once, even if a scene is given twice."""
    return list(
        dict.fromkeys((target.path, target.content) for work in works.values() for target in work.targets)
    )


def _rendered(work: Work, progress: Progress) -> Rendered:
    """Render a scene, with the sample counts that its target error needs."""
    start = time.perf_counter()
    job, options = work.job, work.job.options
    if options.target_error is None:
        paths, report = render_prepared(work, progress)
        return Rendered(job.scene, paths, report)
    choice, memory = _choice(job, options.target_error)
    overrides = (*options.overrides, *choice.overrides)
    work = prepared(replace(job, options=replace(options, overrides=overrides, audit=False)))
    paths, report = render_prepared(work, progress, memory)
    report = replace(
        report,
        error=choice.as_data(),
        audited_error={camera: error.as_data() for camera, error in choice.audited.items()},
        total_seconds=time.perf_counter() - start,
    )
    return Rendered(job.scene, paths, report, choice.overrides)


def _choice(job: RenderJob, target: float) -> tuple[SamplingChoice | ReconstructedChoice, MemoryCache]:
    """Counts for a target error, reconstructed where that reaches it, and buffers that are computed
    already."""
    from illumcli.accuracy.reconstructed_target import Attempts, choose_reconstruction
    from illumcli.accuracy.target import choose_sampling

    options = job.options
    threads = options.threads or len(os.sched_getaffinity(0))
    store = open_store() if options.cache else None
    attempts = Attempts(job.scene, options.overrides, options.only, options.seed, threads, store)
    reconstructed = choose_reconstruction(attempts, target)
    if reconstructed is not None:
        return reconstructed, reconstructed.memory
    raw = choose_sampling(job.scene, target, options.overrides, options.only, options.seed, options.threads)
    return raw, MemoryCache()
