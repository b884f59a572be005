"""Bakes channels at the vertices and texels of a mesh or scene, with their standard errors, into files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from illumcli import __version__
from illumcli.baking.at_texels import baked_texture, sampled_at_texels
from illumcli.baking.at_vertices import sampled_at_vertices
from illumcli.baking.baked_texture import BakedTextures
from illumcli.baking.context import BakeContext, BakedChannels, SampleStatistics, VertexChannels
from illumcli.baking.fit import fitted_to_surface
from illumcli.baking.inputs import BakeWork, prepare_bake
from illumcli.baking.measures import measures
from illumcli.baking.occluders import occluders_of
from illumcli.baking.outputs import pose_warnings, write_outputs
from illumcli.baking.report import BakeReport
from illumcli.baking.resume import open_journal, write_beside
from illumcli.baking.settings import AS_USUAL, BakeJob, BakeOptions, BakeSettings
from illumcli.baking.texture_files import write_texture
from illumcli.baking.values import baked_values
from illumcli.baking.warnings import color_warnings, journal_warnings, warnings_of
from illumcli.files.journal import Journal, tidy
from illumcli.files.outputs import refresh
from illumcli.progress import Progress, no_progress
from illumcli.rays.ray_loop import ray_loop_name

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
    values = BakedChannels()
    left_out: Sequence[str] = ()
    warnings: list[str] = []
    if due:
        with closing(open_journal(work.outputs[0], work.content)) as journal:
            values = baked_of(work, due, bake_context(work, progress, journal))
            left_out = write_beside(journal, partial(write_files, work, due, values))
            warnings = [*warnings_of(values), *color_warnings(work, due)]
            warnings += [*pose_warnings(work.path), *journal_warnings(work, journal)]
            journal.remove()
        work.clock.lap("write")
    tidy(work.outputs[0])
    return list(work.outputs), bake_report(work, due, values, left_out, warnings)


def bake_context(work: BakeWork, progress: Progress, journal: Journal) -> BakeContext:
    """What the methods of a bake need."""
    geometry, settings = work.surfaces.geometry, work.settings
    occluders = occluders_of(work.scene.object_names(), geometry, settings, work.occluding)
    wanted = measures(settings, geometry.render_space.radius)
    work.clock.lap("build")
    threads, clock = work.job.threads, work.clock
    return BakeContext(work.surfaces, occluders, wanted, settings, threads, progress, clock, journal)


def baked_of(work: BakeWork, due: Sequence[Path], context: BakeContext) -> BakedChannels:
    """Values at vertices by the method of the settings, and at texels, as the files need them."""
    at_vertices = at_texels = None
    if any(path not in work.texture_of for path in due):
        at_vertices = METHODS[work.settings.method](context)
    if any(work.has_textures(path) for path in due):
        at_texels = sampled_at_texels(context, work.slots)
    return BakedChannels(at_vertices, at_texels)


def write_files(work: BakeWork, due: Sequence[Path], values: BakedChannels) -> Sequence[str]:
    """Write the files `due`. Returns a line for each part of the input that they lack."""
    # Textures, each in a file of its own.
    textures = BakedTextures()
    if values.at_texels is not None:
        about = description(work, values.at_texels.of_points.statistics)
        of_slots = [
            (each.slot, baked_texture(each, values.at_texels.of_points))
            for each in values.at_texels.texels.textures
        ]
        for slot, texture in of_slots:
            for path in due:
                file = work.texture_of.get(path)
                if file is not None and file.slot == slot:
                    write_texture(path, texture, file.what, about, work.settings.bits)
        textures = BakedTextures(tuple(texture for _, texture in of_slots), values.at_texels.unwrapped)

    # Values at vertices, in all other files.
    if values.at_vertices is None:
        return ()
    about = description(work, values.at_vertices.of_points.statistics)
    baked = replace(baked_values(values.at_vertices), about=about)
    return write_outputs(work, [path for path in due if path not in work.texture_of], baked, textures)


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


def bake_report(
    work: BakeWork,
    due: Sequence[Path],
    values: BakedChannels,
    left_out: Sequence[str],
    warnings: list[str],
) -> BakeReport:
    """The report of a bake that wrote the files `due`."""
    # If nothing was computed, the counts are 0.
    vertices = None if values.at_vertices is None else values.at_vertices.vertices
    texels = None if values.at_texels is None else values.at_texels.texels
    sampled = {} if values.at_vertices is None else values.at_vertices.of_points.statistics
    sampled_texels = {} if values.at_texels is None else values.at_texels.of_points.statistics
    statistics = [*sampled.values(), *sampled_texels.values()]
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
        sampled=sampled,
        textures=[each.as_data() for each in texels.textures] if texels else [],
        sampled_texels=sampled_texels,
        ray_loop=ray_loop_name() if any(each.rays for each in statistics) else None,
        # What was repaired, left out and written.
        repairs=work.repairs,
        left_out=list(left_out),
        warnings=warnings,
        seconds=dict(work.clock.seconds),
        written=[str(path) for path in due],
        kept=[str(path) for path in work.outputs if path not in due],
    )
