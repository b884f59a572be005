"""Renders a scene with the sample counts that its target error needs."""

from __future__ import annotations

import os
import time
from dataclasses import replace
from pathlib import Path

from illumcli.accuracy.reconstructed_target import Attempts, ReconstructedChoice, choose_reconstruction
from illumcli.accuracy.target import SamplingChoice, choose_sampling
from illumcli.cache.memory import MemoryCache
from illumcli.cache.recorder import Cache
from illumcli.cache.store import Store
from illumcli.commands.options import RenderJob
from illumcli.commands.render import rendered
from illumcli.commands.report import Report
from illumcli.commands.work import Work, prepared
from illumcli.progress import Progress
from illumcli.scene.animation import overrides_of_frame


def rendered_to_target(work: Work, store: Store | None, progress: Progress) -> tuple[list[Path], Report]:
    """Choose sample counts that reach the target error of a job, and render its scene with them."""
    start = time.perf_counter()
    options = work.job.options
    options = replace(options, overrides=(*options.overrides, *overrides_of_frame(work.loaded)))
    job, images = replace(work.job, options=options), work.images
    assert options.target_error is not None
    choice, memory = _choice(job, options.target_error, store)
    overrides = (*options.overrides, *choice.overrides)
    work = prepared(replace(job, options=replace(options, overrides=overrides, audit=False)))
    work = replace(work, audited=choice.audited, images=images)
    report = replace(
        rendered(work, Cache(store, memory), progress),
        chosen=choice.overrides,
        error=choice.as_data(),
        audited_error={camera: error.as_data() for camera, error in choice.audited.items()},
        total_seconds=time.perf_counter() - start,
    )
    return [target.path for target in work.targets], report


def _choice(
    job: RenderJob, target: float, store: Store | None
) -> tuple[SamplingChoice | ReconstructedChoice, MemoryCache]:
    """Counts for a target error, reconstructed where that reaches it, and buffers that are computed
    already."""
    options = job.options
    threads = options.threads or len(os.sched_getaffinity(0))
    attempts = Attempts(job.scene, options.overrides, options.only, options.seed, threads, store)
    reconstructed = choose_reconstruction(attempts, target)
    if reconstructed is not None:
        return reconstructed, reconstructed.memory
    raw = choose_sampling(job.scene, target, options.overrides, options.only, options.seed, options.threads)
    return raw, MemoryCache()
