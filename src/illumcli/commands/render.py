"""Render a scene: prepare, plan, execute, write the images of each camera."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from illumcli.cache.recorder import NO_CACHE, Cache
from illumcli.commands.options import RenderJob
from illumcli.commands.report import Report
from illumcli.commands.unit import Worker
from illumcli.commands.unused import unused_keys
from illumcli.commands.work import Work
from illumcli.commands.write_view import write_view
from illumcli.files.outputs import refresh
from illumcli.geometry.repairs import Repairs
from illumcli.progress import Progress, no_progress
from illumcli.render_graph.build import Graph
from illumcli.render_graph.culling import without_objects
from illumcli.render_graph.execute import Run, run_once
from illumcli.render_graph.expected_time import units_of
from illumcli.render_graph.explain import obscurance_files, why_not
from illumcli.render_graph.framing import place_cameras
from illumcli.render_graph.pipeline import place_and_cull, plan_view
from illumcli.render_graph.proportions import disproportion_lines
from illumcli.render_graph.repairs import refuse_repairs, repairs, repairs_of
from illumcli.render_graph.schedule import lasting_keys, shared_keys
from illumcli.render_graph.tile_nodes import RenderStats


def render_scene(job: RenderJob, progress: Progress = no_progress) -> tuple[list[Path], Report]:
    """Render a scene. Returns the paths of all images, written or kept, and the report.

    Raises
    ------
    InputError, LimitError, OutputError
        Before anything is rendered, if the fault can be found by then.
    """
    start, worker = time.perf_counter(), Worker()
    work = worker.prepare(job)
    paths, report = worker.run(work, progress)
    warnings = (*report.warnings, *unused_keys(work), *worker.finish())
    return paths, replace(report, warnings=warnings, total_seconds=time.perf_counter() - start)


def rendered(
    work: Work, cache: Cache = NO_CACHE, progress: Progress = no_progress, following: Work | None = None
) -> Report:
    """Render the files that are due; the cache's memory keeps the buffers that `following` reads."""
    start = time.perf_counter()
    options, outputs = work.job.options, work.outputs
    run = Run(RenderStats(), cache, options.threads or len(os.sched_getaffinity(0)))
    path, due = str(work.loaded.path), work.due()

    # For all views: place the cameras, and cull objects.
    graph = work.graph
    if due:
        # With `strict`, repairs of objects that no view sees are refused too.
        graph = place_cameras(graph, run) if options.strict else place_and_cull(graph, outputs, run)
        if cache.memory is not None:
            cache.memory.want(wanted_by(following, work, graph, run))
    skipped = why_not(graph, outputs)
    repaired: Repairs = {}
    if options.strict and not due:
        repaired = repairs_of(graph, outputs)
        refuse_repairs(path, repaired)

    # Render each view that has files to write.
    reused: dict[str, Mapping[str, str]] = {}
    standard_error: dict[str, dict[str, float]] = {}
    audited_error: dict[str, dict[str, str | float]] = {}
    warnings: Sequence[str] = ()
    clamped = 0
    units: Counter[str] = Counter(dict.fromkeys(run.stats.seconds, 1))  # meshes that were read to cull
    for view in graph.views:
        targets = [replace(target, view=view) for target in due if target.view.name == view.name]
        if not targets:
            continue
        began = time.perf_counter()
        plan = plan_view(graph, outputs, view, cache, rows=targets[0].rows)
        run.stats.add({"artifacts": time.perf_counter() - began}, {})
        reused[view.name] = dict(plan.lookup.reused)
        skipped = why_not(graph, outputs, plan)
        units.update(units_of(plan))
        shared = run_once(plan, run)
        repaired = {**repaired, **repairs(shared)}
        if "ray_origins" in plan.buffers:
            warnings = disproportion_lines(work.loaded, graph, shared.get("object_bounds"))
        if options.strict:
            refuse_repairs(path, repaired)
        outcome = write_view(work, plan, shared, targets, run, progress)
        clamped += outcome.clamped
        if outcome.sums.pixels:
            standard_error[view.name] = outcome.sums.as_data()
        if outcome.audited is not None:
            audited_error[view.name] = outcome.audited.as_data()

    # Refresh the files that are kept, and report.
    kept = [target.path for target in work.targets if target not in due]
    for image in kept:
        refresh(image)
    report = Report(
        path,
        work.content,
        work.scene.seed,
        run.threads,
        written=tuple(str(target.path) for target in due),
        kept=tuple(map(str, kept)),
        skipped=skipped,
        whole=work.whole_because,
        repairs=repaired,
        reused=reused,
        obscurance_files=obscurance_files(graph, outputs),
        warnings=tuple(warnings),
        clamped=clamped,
        standard_error=standard_error,
        audited_error=audited_error,
    )
    seconds = time.perf_counter() - start
    if cache.speeds is not None:
        cache.speeds.add(run.stats.seconds, units, seconds * run.threads)
    return replace(report.with_counts(run.stats), total_seconds=seconds)


def wanted_by(following: Work | None, work: Work, graph: Graph, run: Run) -> frozenset[str]:
    """Keys of the buffers of a graph that the next variant reads; or that any variant might, if whoever holds
    the images may ask for more."""
    if work.images.held:
        return lasting_keys(graph, work.outputs)
    if following is None:
        return frozenset()
    other = without_objects(place_cameras(following.graph, run), graph.culled)
    return shared_keys(graph, other, following.outputs)
