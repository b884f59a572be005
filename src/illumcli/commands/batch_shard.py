"""A shard of a batch, of scenes or inputs of a bake, and the batch's report that is merged from shards."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any, TypeAlias

from illumcli.baking.report import BakeReport
from illumcli.baking.settings import BakeJob
from illumcli.cache.fingerprint import digest
from illumcli.commands.batch import Batch, BatchReport
from illumcli.commands.merged_shards import MergedShards
from illumcli.commands.options import RenderJob
from illumcli.commands.report import Report
from illumcli.commands.runner import PlannedPieces, Runner
from illumcli.commands.sharding import Sharding
from illumcli.commands.unit import Unit, Worker
from illumcli.commands.work import Work
from illumcli.errors import IllumError, unless_faulty
from illumcli.progress import Progress
from illumcli.records import Value

Done: TypeAlias = Callable[[Unit, list[Path], Any], Report | BakeReport]
"""Called with a finished unit, its files and report; returns the report to record."""


class BatchUnits(Value):
    """What a shard of a batch does."""

    units: Sequence[RenderJob | BakeJob]
    """Of the whole batch."""
    sharding: Sharding
    force: bool


def run_shard(of: BatchUnits, batch: Batch, worker: Worker, runner: Runner, done: Done) -> str:
    """Do the units of a shard, and write its record. Returns lines about it.

    Raises
    ------
    IllumError
        At the end if any unit failed.
    """
    batch.leave_all_but(of.sharding.own)
    contents: dict[int, tuple[str, ...]] = {}
    planned = PlannedPieces()

    # Find faults before the first ray.
    for number in batch.due():
        with batch.piece(number):
            work = worker.prepare(of.units[number])
            contents[number] = work.contents
            planned.add(number, work)
            del work
    of.sharding.look(contents, of.force)

    # Do the units; buffers that the next one of the same scene reads stay in memory.
    upcoming: dict[int, Work] = {}

    def run(number: int, progress: Progress) -> tuple[list[Path], Report | BakeReport]:
        nonlocal upcoming
        work = upcoming.pop(number, None) or worker.prepare(of.units[number])
        if not isinstance(work, Work):
            return worker.run(work, progress)
        upcoming = _following(of, number, worker)
        return worker.run(work, progress, next(iter(upcoming.values()), None))

    for number, result in runner.results(batch, planned.pieces(of.units.__getitem__, run)):
        with batch.piece(number):
            report = done(of.units[number], *result())
            of.sharding.add(number, report.as_data())
    lines = [*worker.finish(), of.sharding.finish(batch)]
    batch.finish()
    return "\n".join(lines)


def _following(of: BatchUnits, number: int, worker: Worker) -> dict[int, Work]:
    """The work of the shard's next unit by its index, if it is of the same scene and has no fault."""
    unit = of.units[number]
    later = next((each for each in of.sharding.own if each > number), number)
    following = of.units[later]
    if later == number or not isinstance(unit, RenderJob) or not isinstance(following, RenderJob):
        return {}
    work = unless_faulty(partial(worker.prepare, following)) if following.scene == unit.scene else None
    return {} if work is None else {later: work}


def merge_batch(whole: MergedShards, force: bool) -> tuple[list[Path], list[Path]]:
    """Write the report of a batch whose files are merged. Returns its path as one that was written, or as
    one that is kept."""
    path = whole.outputs.get("report")
    if path is None:
        return [], []
    of_entries = [
        list(numbers)
        for _, numbers in groupby(range(len(whole.units)), lambda k: whole.units[k].about["entry"])
    ]
    report = BatchReport(path, [dict(whole.units[numbers[0]].about["of"]) for numbers in of_entries])
    failures: dict[int, Exception] = {}
    for entry, numbers in enumerate(of_entries):
        missing = [whole.missing[number] for number in numbers if number in whole.missing]
        if missing:
            failures[entry] = IllumError("; ".join(missing))
            continue
        report.plan(entry, _content(whole, numbers))
        report.add(entry, _data(whole, numbers))
    report.look(force)
    return ([], [path]) if report.write(failures) else ([path], [])


def _content(whole: MergedShards, numbers: Sequence[int]) -> str:
    """The content of the entry of some units, as `render` and `ao-bake` form it."""
    names = [str(path) for number in numbers for path in whole.paths(number)]
    contents = [content for number in numbers for content in whole.contents[number]]
    if whole.command == "render":
        return digest((digest(contents), names, whole.settings["target_error"]))
    return digest((contents[0], names))


def _data(whole: MergedShards, numbers: Sequence[int]) -> dict[str, Any]:
    """The entry of some units: one input, or all cameras of a scene."""
    first, *others = (whole.reports[number] for number in numbers)
    if whole.command != "render":
        return dict(first)
    hashed = digest([content for number in numbers for content in whole.contents[number]])
    joined = Report.of_data(first).joined([*map(Report.of_data, others)])
    return {**whole.units[numbers[0]].about["of"], **replace(joined, scene_hash=hashed).as_data()}
