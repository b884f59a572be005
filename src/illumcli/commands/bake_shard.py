"""Bake a shard of several inputs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from illumcli.baking.inputs import bake_cost, bake_files
from illumcli.baking.report import BakeReport
from illumcli.baking.settings import BakeJob
from illumcli.commands.bake import BakeRequest
from illumcli.commands.batch import Batch, Tell
from illumcli.commands.batch_shard import BatchUnits, run_shard
from illumcli.commands.runner import Runner
from illumcli.commands.sharding import PlannedUnit, Sharding
from illumcli.commands.unit import Unit, Worker
from illumcli.errors import unless_faulty
from illumcli.render_graph.costs import Cost


def bake_shard(
    inputs: Sequence[Path],
    request: BakeRequest,
    report: Path | None,
    runner: Runner,
    written: Callable[[Path, list[Path], BakeReport], None],
    tell: Tell,
) -> str:
    """Bake the inputs in the shard of a request. Returns lines about it.

    `written` is called with each finished input, its files and report; `tell` with the errors of the others.

    Raises
    ------
    IllumError
        At the end if any of them failed; at once if files have equal names.
    """
    assert request.shard is not None
    request.refuse_shared_outputs(inputs)
    jobs = [request.job(path) for path in inputs]
    planned = [
        PlannedUnit(str(job.path), _files(job), _cost(job), {"entry": k, "of": {"input": str(job.path)}})
        for k, job in enumerate(jobs)
    ]
    settings = {"settings": request.settings.as_data()}
    sharding = Sharding("ao-bake", request.shard, planned, {"report": report}, settings)

    def done(unit: Unit, paths: list[Path], report: Any) -> BakeReport:
        assert isinstance(unit, BakeJob)
        baked: BakeReport = report
        written(unit.path, paths, baked)
        return baked

    batch = Batch("inputs", len(jobs), request.keep_going, tell)
    units = BatchUnits(jobs, sharding, request.options.force)
    return run_shard(units, batch, Worker(), runner, done)


def _files(job: BakeJob) -> tuple[Path, ...]:
    """The files of a bake; its outputs as they are named for an input with a fault."""
    return unless_faulty(partial(bake_files, job)) or job.outputs


def _cost(job: BakeJob) -> Cost:
    """The cost of a bake; nothing for an input with a fault."""
    cost = unless_faulty(partial(bake_cost, job)) or 0
    return Cost(cost, cost)
