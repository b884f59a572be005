"""Render a shard of scenes and their frames; a unit is what one camera sees, or a band of a large picture."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from illumcli.commands.bands import band_counts, rows_of_bands
from illumcli.commands.batch import Batch, Tell
from illumcli.commands.batch_shard import BatchUnits, run_shard
from illumcli.commands.options import RenderFiles, RenderJob, RenderOptions
from illumcli.commands.render_all import Rendered, entry_of, once
from illumcli.commands.render_jobs import RenderJobs
from illumcli.commands.report import Report
from illumcli.commands.runner import Runner
from illumcli.commands.sharding import PlannedUnit, Sharding
from illumcli.commands.targets import band_of
from illumcli.commands.unit import Unit
from illumcli.commands.unit_cost import cost_of
from illumcli.errors import unless_faulty
from illumcli.files.names import check_unique
from illumcli.film.develop import Target
from illumcli.records import Value
from illumcli.render_graph.costs import Cost, CostModel


def render_shard(
    scenes: Sequence[Path],
    options: RenderOptions,
    about_all: RenderFiles,
    runner: Runner,
    written: Callable[[Rendered], None],
    tell: Tell,
) -> str:
    """Render the units in the shard of `options`. Returns lines about it.

    `written` is called with each rendered unit, `tell` with the error of each that failed.

    Raises
    ------
    IllumError
        At the end if any of them failed; at once if files have equal names.
    """
    assert options.shard is not None
    jobs = RenderJobs(scenes, replace(options, shard=None))
    batch_units, planned = _units(jobs, options.shard.count)
    check_unique([str(path) for path in dict.fromkeys(path for unit in planned for path in unit.files)])
    settings = {"target_error": options.target_error}
    sharding = Sharding("render", options.shard, planned, {"report": about_all.report}, settings)

    def done(unit: Unit, paths: list[Path], report: Any) -> Report:
        assert isinstance(unit, RenderJob)
        rendered: Report = replace(report, warnings=(*report.warnings, *jobs.unused(unit.scene)))
        written(Rendered(unit.scene, paths, rendered, unit.frame))
        return rendered

    batch = Batch("units", len(planned), options.keep_going, once(tell))
    return run_shard(BatchUnits(batch_units, sharding, options.force), batch, jobs.worker, runner, done)


class _Picture(Value):
    """What a camera sees of a job, or all of its cameras: a unit, or several bands."""

    unit: RenderJob
    planned: PlannedUnit
    targets: tuple[Target, ...] = ()
    """Its files, if it can be cut."""

    def bands(self, count: int) -> Iterator[tuple[RenderJob, PlannedUnit]]:
        """At most `count` units."""
        whole, rows_of_each = self.planned, rows_of_bands(self.targets[0].view, count)
        each = whole.cost.alone // len(rows_of_each)
        cost = Cost(each, each)  # bands are spread: those near each other cost more, or less, than the others
        picture = {"name": whole.name, "files": whole.files, "contents": whole.about["contents"]}
        for rows in rows_of_each:
            parts = [band_of(target, rows) for target in self.targets]
            name = f"{whole.name}, rows {rows[0]} to {rows[1] - 1}"
            about = {**whole.about, "contents": [part.content for part in parts], "picture": picture}
            yield (
                replace(self.unit, rows=rows),
                PlannedUnit(name, tuple(part.path for part in parts), cost, about),
            )


def _units(jobs: RenderJobs, shards: int) -> tuple[list[RenderJob], list[PlannedUnit]]:
    """The units of all jobs."""
    pictures = list(_pictures(jobs))
    counts = band_counts([each.planned.cost.alone for each in pictures], shards)
    units = list[tuple[RenderJob, PlannedUnit]]()
    for picture, count in zip(pictures, counts, strict=True):
        is_cut = count > 1 and picture.targets
        units += picture.bands(count) if is_cut else [(picture.unit, picture.planned)]
    return [unit for unit, _ in units], [planned for _, planned in units]


def _pictures(jobs: RenderJobs) -> Iterator[_Picture]:
    """What each camera sees of each job; all of them together for a job with a fault or a target error."""
    model = CostModel()
    for number, job in enumerate(jobs):
        about = {"entry": number, "of": entry_of(job)}
        label = ", ".join(filter(None, (str(job.scene), jobs.label(number))))
        work = unless_faulty(partial(jobs.planned, number))
        if work is None:
            yield _Picture(job, PlannedUnit(label, (), about=about))
            continue
        jobs.drop(number)
        cameras = tuple(dict.fromkeys(target.view.name for target in work.targets))
        by_camera = job.options.target_error is None
        for names in [(camera,) for camera in cameras] if by_camera else [cameras]:
            targets = tuple(target for target in work.targets if target.view.name in names)
            part = replace(work, targets=targets)
            name = label if names == cameras else f"{label}, camera {names[0]}"
            files = tuple(target.path for target in targets)
            facts = {**about, "contents": part.contents}
            planned = PlannedUnit(name, files, cost_of(part, model), facts)
            yield _Picture(replace(job, cameras=names), planned, () if work.whole_because else targets)
