"""Render scenes and their frames: faults are reported before the first ray, and the others are rendered."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from illumcli.cache.fingerprint import digest
from illumcli.commands.batch import Batch, BatchReport, Tell
from illumcli.commands.options import RenderFiles, RenderJob, RenderOptions
from illumcli.commands.render_jobs import RenderJobs
from illumcli.commands.report import Report
from illumcli.commands.runner import Cut, PlannedPieces, Runner
from illumcli.files.names import check_unique
from illumcli.progress import Progress
from illumcli.records import Value
from illumcli.scene.frames import FRAMES_PER_SECOND
from illumcli.scene.problems import without_value

if TYPE_CHECKING:
    from illumcli.commands.render_html import RenderPage


class Rendered(Value):
    """A rendered scene, or a frame of it."""

    scene: Path
    paths: list[Path]
    report: Report
    frame: int | None = None
    fps: float = FRAMES_PER_SECOND


def render_scenes(
    scenes: Sequence[Path],
    options: RenderOptions,
    about_all: RenderFiles,
    runner: Runner,
    written: Callable[[Rendered], None],
    tell: Tell,
) -> list[Path]:
    """Render every scene, or every frame of it. Returns the files about all that are kept because they would
    be the same.

    `written` is called with each rendered scene or frame, `tell` with the error of each that failed.

    Raises
    ------
    IllumError
        At the end if any scene failed; at once if files have equal names or the report cannot be written.
    """
    jobs = RenderJobs(scenes, options)
    what = "frames" if any(job.frame is not None for job in jobs) else "scenes"
    batch = Batch(what, len(jobs), options.keep_going, once(tell) if what == "frames" else tell)
    entries = BatchReport(about_all.report, [entry_of(job) for job in jobs])
    page = _page(about_all.html, jobs)
    planned = PlannedPieces()
    files: dict[tuple[Path, str], None] = {}  # every file once, even if a scene is given twice

    # Find faults before the first ray.
    for number in batch.due():
        with batch.piece(number, jobs.label(number)):
            work = jobs.planned(number)
            planned.add(number, work)
            names = [str(target.path) for target in work.targets]
            entries.plan(number, digest((work.content, names, options.target_error)))
            if page is not None:
                page.plan(number, work)
            files |= dict.fromkeys((target.path, target.content) for target in work.targets)
    check_unique([str(path) for path, _ in files])
    entries.look(options.force)
    if page is not None:
        page.look(options.force)

    # Render; buffers that the next frame reads stay in memory.
    def run(number: int, progress: Progress) -> tuple[list[Path], Report]:
        work, following = jobs.work(number), jobs.following(number)
        paths, done = jobs.worker.run(work, progress, following)
        ending = jobs.worker.finish() if following is None else ()
        return paths, replace(done, warnings=(*done.warnings, *ending))

    def cut() -> Cut[tuple[list[Path], Report]]:
        from illumcli.commands.bands import CutJobs  # for several workers

        return CutJobs(jobs)

    for number, result in runner.results(batch, planned.pieces(jobs.unit, run, cut)):
        with batch.piece(number, jobs.label(number)):
            paths, done = result()
            job = jobs.unit(number)
            done = replace(done, warnings=(*done.warnings, *jobs.unused(job.scene)))
            if page is not None:
                page.add(number, done)
            if about_all.report is not None:
                entries.add(number, entry_of(job) | done.as_data())
            written(Rendered(job.scene, paths, done, job.frame, jobs.fps(job.scene)))
        jobs.drop(number)
    kept = page.write(batch.failures) if page is not None else []
    return [*entries.finish(batch), *kept]


def _page(folder: Path | None, jobs: RenderJobs) -> RenderPage | None:
    """The report for a browser, if it is asked for."""
    if folder is None:
        return None
    from illumcli.commands.render_html import RenderPage

    return RenderPage(folder, jobs)


def once(tell: Tell) -> Tell:
    """Tells a fault at the first frame that has it, and names the frame once."""
    told: set[str] = set()

    def tell_once(text: str) -> None:
        fault = without_value(text)
        if fault not in told:
            tell(text.partition(": ")[2] if ": at frame " in text else text)
        told.add(fault)

    return tell_once


def entry_of(job: RenderJob) -> dict[str, Any]:
    """What the report says of a job before it is done."""
    return {"scene": str(job.scene)} | ({} if job.frame is None else {"frame": job.frame})
