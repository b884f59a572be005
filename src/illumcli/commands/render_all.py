"""Render several scenes: faults are reported before the first ray, and the other scenes are rendered."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from illumcli.cache.fingerprint import digest
from illumcli.commands.batch import Batch, BatchReport, Tell
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.report import Report
from illumcli.commands.turns import turns
from illumcli.commands.unit import Worker
from illumcli.commands.work import Work, unused_keys
from illumcli.files.names import check_unique
from illumcli.progress import Progress
from illumcli.records import Value


class Rendered(Value):
    """A rendered scene."""

    scene: Path
    paths: list[Path]
    report: Report


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
    worker, works, claims = Worker(), dict[int, Work](), dict[int, Path | None]()
    entries = BatchReport(report, [{"scene": str(scene)} for scene in scenes])

    # Find faults before the first ray.
    for number in batch.due():
        with batch.piece(number):
            works[number] = work = worker.prepare(RenderJob(scenes[number], options))
            claims[number] = work.claim if work.due() else None
            names = [str(target.path) for target in work.targets]
            entries.plan(number, digest((work.content, names, options.target_error)))
    check_unique([str(path) for path, _ in _files(works)])
    entries.look(options.force)

    # Render.
    for number in turns(batch, claims.__getitem__, progress):
        with batch.piece(number):
            work = works.pop(number)
            paths, done = worker.run(work, progress)
            done = replace(done, warnings=(*done.warnings, *unused_keys(work), *worker.finish()))
            if report is not None:
                entries.add(number, done.as_data())
            written(Rendered(work.job.scene, paths, done))
    return entries.finish(batch)


def _files(works: dict[int, Work]) -> list[tuple[Path, str]]:
    """Every file once, even if a scene is given twice."""
    return list(
        dict.fromkeys((target.path, target.content) for work in works.values() for target in work.targets)
    )
