"""Render several scenes: what is wrong with any of them is told before the first ray, the others are done."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from illumcli.cache.fingerprint import digest
from illumcli.commands.batch import Batch, BatchReport, Tell
from illumcli.commands.render import Progress, Report, Work, prepared, run_prepared
from illumcli.files.names import check_unique
from illumcli.records import Value
from illumcli.scene.load import load


class Settings(Value):
    """What all scenes are rendered with."""

    overrides: tuple[str, ...] = ()
    pattern: str | None = None
    only: tuple[str, ...] = ()
    seed: int | None = None
    threads: int | None = None
    target_error: float | None = None
    force: bool = False
    cache: bool = True
    strict: bool = False
    keep_going: bool = True

    def prepared(self, scene: Path) -> Work:
        """The scene loaded and planned."""
        return prepared(load(scene, self.overrides), self.pattern, self.only, self.seed)


class Rendered(Value):
    """A scene that is done."""

    scene: Path
    paths: list[Path]
    report: Report
    counts: tuple[str, ...] = ()
    """What `target_error` chose, as `-D` has it."""


def run(
    scenes: Sequence[Path],
    settings: Settings,
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
    batch = Batch("scenes", len(scenes), settings.keep_going, tell)
    works: dict[int, Work] = {}
    whole = BatchReport(report, [{"scene": str(scene)} for scene in scenes])

    # all that can be known before the first ray
    for number in batch.due():
        with batch.piece(number):
            works[number] = work = settings.prepared(scenes[number])
            work.due(settings.force)
            names = [str(target.path) for target in work.targets]
            whole.plan(number, digest((work.content, names, settings.target_error)))
    check_unique([str(path) for path, _ in _files(works)])
    whole.look(settings.force)

    for number in batch.due():
        with batch.piece(number):
            done = _rendered(scenes[number], works.pop(number), settings, progress)
            whole.add(number, done.report.as_data())
            written(done)
    return whole.finish(batch)


def _files(works: dict[int, Work]) -> list[tuple[Path, str]]:
    """Every file once: a scene that is named twice makes the same files twice."""
    return list(
        dict.fromkeys((target.path, target.content) for work in works.values() for target in work.targets)
    )


def _rendered(scene: Path, work: Work, settings: Settings, progress: Progress) -> Rendered:
    """The scene rendered, with as many samples as the error that is asked for takes."""
    start = time.perf_counter()
    choice = None
    if settings.target_error is not None:
        from illumcli.accuracy.target import choose_sampling

        choice = choose_sampling(
            scene, settings.target_error, settings.overrides, settings.only, settings.seed, settings.threads
        )
        settings = replace(settings, overrides=(*settings.overrides, *choice.overrides))
        work = settings.prepared(scene)
    paths, report = run_prepared(
        work, settings.pattern, settings.threads, settings.force, progress, settings.cache, settings.strict
    )
    if choice is not None:
        report.error = choice.as_data()
    report.total_seconds = time.perf_counter() - start
    return Rendered(scene, paths, report, choice.overrides if choice else ())
