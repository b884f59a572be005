"""A shard of a sweep: what its record says, and the sweep that is read back from records."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from illumcli.commands.batch import Batch
from illumcli.commands.merged_shards import MergedShards
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.report import Report
from illumcli.commands.sharding import PlannedUnit, Sharding
from illumcli.commands.sweep_files import SweepFiles, plan_files
from illumcli.commands.sweep_outcome import Outcome, PlannedImage, PlannedVariant
from illumcli.commands.sweep_planning import SweepPlan
from illumcli.commands.sweep_works import SweepWorks
from illumcli.errors import IllumError
from illumcli.html_report.entries import PAGE
from illumcli.scene.variants import Variant

OF_PLAN = ("content", "height", "width", "channels", "exposure")
"""What a record keeps of the plan of a variant."""
OF_OPTIONS = ("overrides", "only", "seed", "strict")
"""What it keeps of the options; the others are of a run."""


def plan_shard(works: SweepWorks, plan: SweepPlan, files: SweepFiles) -> Sharding | None:
    """The shard of a sweep to render; None if all variants are rendered.

    Raises
    ------
    OutputError
        The record of another command is there, and `force` is not given.
    """
    options = works.options
    if options.shard is None:
        return None
    pairs = zip(plan.outcomes, plan.costs, strict=True)
    units = [PlannedUnit(each.label, each.paths, cost, _about(each)) for each, cost in pairs]
    named = vars(files)
    outputs = {name: value for name, value in named.items() if isinstance(value, Path)}
    settings = {name: value for name, value in named.items() if name not in outputs}
    settings["scene"] = str(works.path)
    settings["options"] = {name: getattr(options, name) for name in OF_OPTIONS}
    assert options.pattern is not None
    settings["pattern"] = Path(options.pattern)
    sharding = Sharding("sweep", options.shard, units, outputs, settings)
    planned = ((number, each.planned) for number, each in enumerate(plan.outcomes) if each.planned)
    contents = {number: tuple(image.content for image in each.images) for number, each in planned}
    sharding.look(contents, options.force)
    return sharding


def record_shard(sharding: Sharding, outcomes: Sequence[Outcome], batch: Batch) -> str:
    """Write the record of a shard. Returns a line about it."""
    for number in sharding.own:
        if (report := outcomes[number].report) is not None:
            sharding.add(number, report.as_data())
    return sharding.finish(batch)


def _about(outcome: Outcome) -> dict[str, object]:
    """The values of a variant, and the facts about its images."""
    planned = outcome.planned
    facts = {} if planned is None else {name: getattr(planned, name) for name in OF_PLAN}
    reference = str(planned.reference) if planned is not None and planned.reference else None
    images = [[image.name, image.content] for image in planned.images] if planned is not None else []
    return {"variant": vars(outcome.variant), "planned": facts, "images": images, "reference": reference}


def merge_sweep(whole: MergedShards, force: bool) -> tuple[list[Path], list[Path]]:
    """Write the sheet, table and report of a sweep whose images are merged. Returns the paths of those that
    were written, and of those that are kept."""
    outcomes = [_outcome(whole, number) for number in range(len(whole.units))]
    settings: dict[str, Any] = dict(whole.settings)
    scene, given = Path(settings.pop("scene")), settings.pop("options")
    pattern = str(whole.folder / settings.pop("pattern"))
    of_job: dict[str, Any] = {
        name: tuple(value) if isinstance(value, list) else value for name, value in given.items()
    }
    job = RenderJob(scene, RenderOptions(pattern=pattern, force=force, **of_job))
    del settings["outputs"]
    files = SweepFiles(**(settings | {**whole.outputs}))
    planned = plan_files(files, outcomes, job)
    if any(outcome.report for outcome in outcomes):
        planned.write(outcomes)
    paths = [path / PAGE if name == "html" else path for name, path in whole.outputs.items()]
    return [path for path in paths if path not in planned.kept], list(planned.kept)


def _outcome(whole: MergedShards, number: int) -> Outcome:
    """The outcome of a variant, with what the records say of it."""
    about, report = whole.units[number].about, whole.reports.get(number)
    variant = Variant(**{**about["variant"], "parts": tuple(about["variant"]["parts"])})
    planned = None
    if about["planned"]:
        reference = Path(about["reference"]) if about["reference"] else None
        images = tuple(PlannedImage(*image) for image in about["images"])
        facts = {**about["planned"], "paths": tuple(whole.paths(number)), "images": images}
        planned = PlannedVariant(reference=reference, is_due=False, claim=None, **facts)
    error = None if report is not None else IllumError(whole.missing.get(number, ""))
    return Outcome(number + 1, variant, planned, None if report is None else Report.of_data(report), error)
