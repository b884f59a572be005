"""The report of a sweep for a browser: what it says of each variant."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from illumcli.commands.options import RenderJob
from illumcli.commands.sweep_outcome import Outcome, PlannedVariant
from illumcli.commands.sweep_reference import Reference
from illumcli.commands.sweep_table import SweepTable
from illumcli.files.names import expand_some
from illumcli.html_report.entries import Contents, Entry, Picture
from illumcli.scene.variants import Variant


def is_html_kept(folder: Path, contents: Sequence[str], force: bool) -> bool:
    """True if the report exists with these contents; see `html_report.folder.is_report_kept`."""
    from illumcli.html_report.folder import is_report_kept

    return is_report_kept(folder, contents, force)


def write_html(folder: Path, contents: Contents) -> None:
    """Write the report."""
    from illumcli.html_report.folder import write_report

    write_report(folder, contents)


def html_contents(
    job: RenderJob,
    outcomes: Sequence[Outcome],
    contents: Sequence[str],
    table: SweepTable,
    references: Mapping[int, Reference],
) -> Contents:
    """What the report says.

    Parameters
    ----------
    job
        The scene, and the options that all variants have.
    contents
        Hash of what the entry of each variant depends on.
    """
    planned = next((outcome.planned for outcome in outcomes if outcome.planned), None)
    entries = tuple(
        Entry(
            label=outcome.variant.label,
            values=_values(outcome.variant),
            content=content,
            state=table.state(outcome),
            command=render_command(_job_of(job, outcome.variant)),
            error=None if outcome.error is None else str(outcome.error),
            measures=table.measures(outcome),
            pictures=pictures_of(outcome.planned) if outcome.planned and outcome.report else {},
            reference=_reference(outcome, references, outcomes),
        )
        for outcome, content in zip(outcomes, contents, strict=True)
    )
    seconds = sum(outcome.report.total_seconds for outcome in outcomes if outcome.report)
    return Contents(job.scene.stem, entries, seconds, planned.height / planned.width if planned else 1.0)


def render_command(job: RenderJob) -> str:
    """The command that renders a job into its files."""
    options = job.options
    words = ["illum", "render", str(job.scene)]
    words += [word for layer in options.only for word in ("--only", layer)]
    words += [] if options.seed is None else ["--seed", str(options.seed)]
    words += [] if options.target_error is None else ["--target-error", str(options.target_error)]
    words += [] if job.frame is None else ["--frames", f"{job.frame}:{job.frame}"]
    words += [word for override in options.overrides for word in ("-D", override)]
    words += [] if options.pattern is None else ["-o", expand_some(options.pattern, job.fields)]
    return shlex.join(words)


def _job_of(job: RenderJob, variant: Variant) -> RenderJob:
    """The job of a variant, from what all have."""
    options = replace(job.options, overrides=tuple(variant.overrides))
    return replace(job, options=options, frame=variant.frame, fields=variant.fields)


def _values(variant: Variant) -> dict[str, str]:
    """The frame and the values of a variant, by their names where they have some."""
    frame = {} if variant.frame is None else {"frame": str(variant.frame)}
    return {**frame, **variant.values, **variant.names}


def pictures_of(planned: PlannedVariant) -> dict[str, Picture]:
    """The pictures of a variant; the camera is left out of the name if there is only one."""
    cameras = {image.name.partition(" ")[0] for image in planned.images}
    names = [
        image.name.partition(" ")[2] or image.name if len(cameras) == 1 else image.name
        for image in planned.images
    ]
    pairs = zip(names, planned.images, planned.paths, strict=True)
    return {name: Picture(path, image.content, planned.exposure) for name, image, path in pairs}


def _reference(
    outcome: Outcome, references: Mapping[int, Reference], outcomes: Sequence[Outcome]
) -> Picture | None:
    """The picture that the errors of a variant are relative to, if both exist."""
    reference = references.get(outcome.number)
    if reference is None or outcome.report is None or outcome.planned is None:
        return None
    if reference.number is None:
        return Picture(reference.path, reference.content, outcome.planned.exposure)
    other = outcomes[reference.number - 1]
    return next(iter(pictures_of(other.planned).values())) if other.planned and other.report else None
