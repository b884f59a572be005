"""Render a shard of scenes and their frames; a unit is what one camera sees."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from illumcli.commands.batch import Batch, Tell
from illumcli.commands.batch_shard import BatchUnits, run_shard
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render_all import Rendered, entry_of, once
from illumcli.commands.render_jobs import RenderJobs
from illumcli.commands.report import Report
from illumcli.commands.runner import Runner
from illumcli.commands.sharding import PlannedUnit, Sharding
from illumcli.commands.unit import Unit
from illumcli.commands.unit_cost import cost_of
from illumcli.errors import unless_faulty
from illumcli.files.names import check_unique
from illumcli.render_graph.costs import CostModel


def render_shard(
    scenes: Sequence[Path],
    options: RenderOptions,
    report: Path | None,
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
    batch_units, planned = _units(jobs, options.target_error is None)
    check_unique([str(path) for path in dict.fromkeys(path for unit in planned for path in unit.files)])
    settings = {"target_error": options.target_error}
    sharding = Sharding("render", options.shard, planned, {"report": report}, settings)

    def done(unit: Unit, paths: list[Path], report: Any) -> Report:
        assert isinstance(unit, RenderJob)
        rendered: Report = replace(report, warnings=(*report.warnings, *jobs.unused(unit.scene)))
        written(Rendered(unit.scene, paths, rendered, unit.frame))
        return rendered

    batch = Batch("units", len(planned), options.keep_going, once(tell))
    return run_shard(BatchUnits(batch_units, sharding, options.force), batch, jobs.worker, runner, done)


def _units(jobs: RenderJobs, by_camera: bool) -> tuple[list[RenderJob], list[PlannedUnit]]:
    """A unit for every job, or for every camera of its scene; one for a job with a fault."""
    units, planned, model = list[RenderJob](), list[PlannedUnit](), CostModel()
    for number, job in enumerate(jobs):
        about = {"entry": number, "of": entry_of(job)}
        label = ", ".join(filter(None, (str(job.scene), jobs.label(number))))
        work = unless_faulty(partial(jobs.planned, number))
        if work is None:
            units.append(job)
            planned.append(PlannedUnit(label, (), about=about))
            continue
        jobs.drop(number)
        cameras = tuple(dict.fromkeys(target.view.name for target in work.targets))
        for names in [(camera,) for camera in cameras] if by_camera else [cameras]:
            targets = tuple(target for target in work.targets if target.view.name in names)
            part = replace(work, targets=targets)
            units.append(replace(job, cameras=names))
            name = label if names == cameras else f"{label}, camera {names[0]}"
            files = tuple(target.path for target in targets)
            facts = {**about, "contents": part.contents}
            planned.append(PlannedUnit(name, files, cost_of(part, model), facts))
    return units, planned
