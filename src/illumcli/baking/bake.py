"""Bakes obscurance at every vertex of a mesh or scene, with its standard error, into files of its meshes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli import __version__
from illumcli.baking.at_vertices import sampled_at_vertices
from illumcli.baking.context import BakeContext, PointChannels, SampleStatistics, VertexChannels
from illumcli.baking.fit import fitted_to_surface
from illumcli.baking.inputs import BakeWork, prepare_bake
from illumcli.baking.occluders import occluders_of
from illumcli.baking.outputs import write_outputs
from illumcli.baking.report import BakeReport
from illumcli.baking.resume import open_journal, write_beside
from illumcli.baking.sampling import MAX_SAMPLES
from illumcli.baking.settings import AS_USUAL, BakeJob, BakeOptions, BakeSettings
from illumcli.baking.values import baked_values
from illumcli.files.journal import Journal, tidy
from illumcli.files.outputs import refresh
from illumcli.progress import Progress, no_progress
from illumcli.rays.ray_loop import ray_loop_name
from illumcli.visibility.obscurance import Method

DARK, MOSTLY = 0.01, 0.9
"""If more than the share `MOSTLY` of the values is below `DARK`, the mesh seems to be inside out."""

METHODS: dict[str, Callable[[BakeContext], VertexChannels]] = {
    "vertex": sampled_at_vertices,
    "fit": fitted_to_surface,
}


def bake_mesh(
    path: Path,
    outputs: Sequence[Path],
    settings: BakeSettings,
    options: BakeOptions = AS_USUAL,
    progress: Progress = no_progress,
) -> tuple[list[Path], BakeReport]:
    """Bake a mesh file, or all meshes of a scene in their places. Returns the files and the report.

    Raises
    ------
    InputError, LimitError, OutputError
        Before anything is baked, if the fault can be found by then.
    """
    return bake_prepared(prepare_bake(BakeJob(path, tuple(outputs), settings, options)), progress)


def bake_prepared(work: BakeWork, progress: Progress = no_progress) -> tuple[list[Path], BakeReport]:
    """Bake a prepared input."""
    # Refresh the files that are kept.
    due = work.due()
    kept = [path for path in work.outputs if path not in due]
    for path in kept:
        refresh(path)
    work.clock.lap("read")

    # Compute the values, with a journal for a next run, and write the files.
    values: VertexChannels | None = None
    left_out: Sequence[str] = ()
    warnings: list[str] = []
    if due:
        with closing(open_journal(work.outputs[0], work.content)) as journal:
            values = vertex_channels(work, progress, journal)
            baked = replace(baked_values(values), about=description(work, values.of_points.statistics))
            write = partial(write_outputs, work, due, baked)
            left_out = write_beside(journal, write)
            warnings = [*warnings_of(work.settings, values.of_points), *journal_warnings(work, journal)]
            journal.remove()
        work.clock.lap("write")
    tidy(work.outputs[0])
    return list(work.outputs), bake_report(work, due, values, left_out, warnings)


def vertex_channels(work: BakeWork, progress: Progress, journal: Journal) -> VertexChannels:
    """The channels of every point at a vertex, by the method of the settings."""
    geometry, settings = work.surfaces.geometry, work.settings
    occluders = occluders_of(work.scene, geometry, settings)
    wanted = settings.obscurance()
    method = Method(
        settings.samples, wanted.falloff, geometry.render_space.radius, wanted.sampler, wanted.faces
    )
    work.clock.lap("build")
    threads, clock = work.job.threads, work.clock
    context = BakeContext(work.surfaces, occluders, method, settings, threads, progress, clock, journal)
    return METHODS[settings.method](context)


def description(work: BakeWork, statistics: Mapping[str, SampleStatistics]) -> dict[str, Any]:
    """The description of a bake that its files contain."""
    names, placed = work.scene.object_names(), work.surfaces.geometry.placed
    return {
        "content": work.content,
        "version": __version__,
        "input": work.path.name,
        "meshes": dict(zip(names, work.hashes, strict=True)),
        "vertices": {name: len(each.mesh.vertices) for name, each in zip(names, placed, strict=True)},
        "corners": {name: len(each.mesh.corners) for name, each in zip(names, placed, strict=True)},
        "parameters": work.settings.as_data(),
        "seed": work.settings.seed,
        "sampled": {name: each.as_data() for name, each in statistics.items()},
    }


def warnings_of(settings: BakeSettings, values: PointChannels) -> list[str]:
    """Warnings about a target that was not reached, and about a mesh that seems to be inside out."""
    warnings = []
    target = settings.target_error
    for name, statistics in values.statistics.items():
        if target is None or statistics.rmse <= target:
            continue
        at_limit = max(statistics.samples, default=0) >= MAX_SAMPLES
        reason = f"no vertex casts more than {MAX_SAMPLES} rays" if at_limit else "trials did not reach it"
        warnings.append(f"error of {name} {statistics.rmse:.2g} is above the {target:g} asked for: {reason}")
    w = values.channels.get("obscurance")
    dark = 0.0 if w is None else dark_share(w)
    if dark > MOSTLY:
        warnings.append(
            f"{dark:.0%} of the values are 0: the polygons seem to face inwards; turn their winding around, "
            "or give the file outward normals"
        )
    return warnings


def dark_share(w: NDArray[np.float32]) -> float:
    """Share of values below `DARK`."""
    return float(np.mean(w < DARK)) if len(w) else 0.0


def journal_warnings(work: BakeWork, journal: Journal) -> list[str]:
    """A warning if an interrupted bake could not be continued by a next run."""
    if journal.refusal is None:
        return []
    output = work.outputs[0]
    return [f"finished pieces are not kept beside {output} for a next run: {journal.refusal}"]


def bake_report(
    work: BakeWork,
    due: Sequence[Path],
    values: VertexChannels | None,
    left_out: Sequence[str],
    warnings: list[str],
) -> BakeReport:
    """The report of a bake that wrote the files `due`; `values` are None if every output is kept."""
    # If nothing was computed, the counts are 0.
    statistics = {} if values is None else values.of_points.statistics
    vertices = None if values is None else values.vertices
    return BakeReport(
        # The input.
        input=str(work.path),
        content=work.content,
        seed=work.settings.seed,
        threads=work.job.threads,
        vertices=len(work.surfaces.geometry.vertices),
        triangles=len(work.surfaces.geometry.triangles),
        unreferenced=vertices.unreferenced if vertices else 0,
        without_normal=vertices.without_normal if vertices else 0,
        copies=vertices.copies if vertices else 0,
        # The values, their errors and rays.
        sampled=statistics,
        target_error=work.settings.target_error,
        ray_loop=ray_loop_name() if any(each.rays for each in statistics.values()) else None,
        # What was repaired, left out and written.
        repairs=work.repairs,
        left_out=list(left_out),
        warnings=warnings,
        seconds=dict(work.clock.seconds),
        written=[str(path) for path in due],
        kept=[str(path) for path in work.outputs if path not in due],
    )
