"""Render several scenes: what is wrong with any of them is told before the first ray, the others are done."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from illumcli.cache.fingerprint import digest
from illumcli.commands.batch import Batch, BatchReport, Tell
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_prepared
from illumcli.commands.report import Report
from illumcli.commands.work import Work, prepared
from illumcli.files.names import check_unique
from illumcli.progress import Progress
from illumcli.records import Value


class Rendered(Value):
    """A scene that is done."""

    scene: Path
    paths: list[Path]
    report: Report
    counts: tuple[str, ...] = ()
    """What `target_error` chose, as `-D` has it."""


def render_scenes(
    scenes: Sequence[Path],
    options: RenderOptions,
    report: Path | None,
    progress: Progress,
    written: Callable[[Rendered], None],
    tell: Tell,
) -> bool:
    """Render every scene; is the report kept, since it holds the same as it would?

    `written` gets each scene that is done, `tell` the fault of each that is not.

    Raises
    ------
    IllumError
        At last, where any scene failed; at once, where files have one name or the report cannot be written.
    """
    batch = Batch("scenes", len(scenes), options.keep_going, tell)
    works: dict[int, Work] = {}
    whole = BatchReport(report, [{"scene": str(scene)} for scene in scenes])

    # all that can be known before the first ray
    for number in batch.due():
        with batch.piece(number):
            works[number] = work = prepared(RenderJob(scenes[number], options))
            work.due()
            names = [str(target.path) for target in work.targets]
            whole.plan(number, digest((work.content, names, options.target_error)))
    check_unique([str(path) for path, _ in _files(works)])
    whole.look(options.force)

    for number in batch.due():
        with batch.piece(number):
            done = _rendered(works.pop(number), progress)
            if report is not None:
                whole.add(number, done.report.as_data())
            written(done)
    return whole.finish(batch)


def _files(works: dict[int, Work]) -> list[tuple[Path, str]]:
    """Every file once: a scene that is named twice makes the same files twice."""
    return list(
        dict.fromkeys((target.path, target.content) for work in works.values() for target in work.targets)
    )


def _rendered(work: Work, progress: Progress) -> Rendered:
    """A scene rendered, with as many samples as the error that is asked for takes."""
    start = time.perf_counter()
    job, options, choice = work.job, work.job.options, None
    if options.target_error is not None:
        from illumcli.accuracy.target import choose_sampling

        choice = choose_sampling(
            job.scene, options.target_error, options.overrides, options.only, options.seed, options.threads
        )
        overrides = (*options.overrides, *choice.overrides)
        work = prepared(replace(job, options=replace(options, overrides=overrides)))
    paths, report = render_prepared(work, progress)
    error = choice.as_data() if choice is not None else {}
    report = replace(report, error=error, total_seconds=time.perf_counter() - start)
    return Rendered(job.scene, paths, report, choice.overrides if choice else ())
