"""Explain a scene's plan."""

from __future__ import annotations

import json
import textwrap
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from illumcli.cache.recorder import Cache
from illumcli.cache.store import open_store
from illumcli.commands.options import RenderOptions
from illumcli.commands.plan_frames import planned_frames
from illumcli.commands.render_jobs import RenderJobs
from illumcli.render_graph.build import build
from illumcli.render_graph.execute import Run
from illumcli.render_graph.explain import plan_data
from illumcli.render_graph.limits import expected_memory, refuse_memory, refuse_rays
from illumcli.render_graph.pipeline import place_and_cull, plan_view
from illumcli.render_graph.schedule import outputs_of
from illumcli.scene.load import load


def plan_scene(
    path: Path,
    overrides: Sequence[str] = (),
    only: Sequence[str] = (),
    as_json: bool = False,
    cache: bool = True,
    frames: str | None = None,
) -> str:
    """The plan of a scene as a table or JSON; with `cache`, of a run that loads what the store holds now.

    With frames it is the plan of the first, and says how many different buffers they need.
    """
    jobs = RenderJobs([path], RenderOptions(tuple(overrides), only=tuple(only), frames=frames))
    first = next(iter(jobs))
    loaded = load(path, first.options.overrides, frame=first.frame)
    graph, outputs = build(loaded.scene, loaded), outputs_of(loaded.scene, only)
    refuse_rays(graph, outputs)
    run = Run(cache=Cache(open_store() if cache else None))

    # Compute nothing: object bounds and cameras are known only if the store has them.
    graph = place_and_cull(graph, outputs, run, only_cached=True)
    plans = [plan_view(graph, outputs, view, run.cache, look=True) for view in graph.views]
    expected = expected_memory(loaded, loaded.scene)
    parts = [plan_data(plan, expected) for plan in plans]
    if (planned := planned_frames(jobs)) is not None:
        for part in parts:
            camera = part["views"][0]["camera"]
            part["frames"] = {"numbers": planned.numbers, "different": planned.different[camera]}
    return json.dumps(parts, indent=1) if as_json else table(parts)


def refuse_too_large(path: Path, overrides: Sequence[str] = (), frames: str | None = None) -> None:
    """Raise LimitError where memory cannot hold the scene's shapes, meshes and textures, at any frame."""
    for job in RenderJobs([path], RenderOptions(tuple(overrides), frames=frames)):
        loaded = load(path, job.options.overrides, frame=job.frame)
        refuse_memory(0, 0, 0, expected_memory(loaded, loaded.scene), str(path))


def table(parts: Sequence[Mapping[str, Any]]) -> str:
    """Plans as text, one per view: what runs once, what runs per tile, what does not run and why."""
    return "\n\n".join("\n".join(_lines(part)) for part in parts)


def _lines(part: Mapping[str, Any]) -> list[str]:
    view, reused = part["views"][0], part["reused"]
    probes = f", or one at its centre, and {view['probes']} first hits" if "probes" in view else ""
    lines = [
        f"view    {view['camera']}: {view['width']} x {view['height']}, "
        f"{view['samples']} samples per pixel{probes}",
        f"objects {part['objects']}",
        _row("layers", part["layers"]),
        _row("once", [name for name in part["once"] if name not in reused]),
        _row("tile", [name for name in part["tile"] if name not in reused]),
        _row("reused", list(reused)),
        _row("rays", [f"{name} {count:,}" for name, count in part["expected_rays"].items()]),
        _row("", [f"traced as {part['ray_loop']}"] if part["ray_loop"] else []),
        _row("memory", [f"{name} {size / 2**20:,.1f} MiB" for name, size in part["expected_bytes"].items()]),
    ]
    if "frames" in part:
        lines += _frame_lines(**part["frames"])
    reasons = defaultdict(list)
    for name, why in part["skipped"].items():
        reasons[why].append(name)
    for why, names in reasons.items():
        lines.append(_row("unused", names) + f"\n          ({why})")
    return [line for line in lines if line.strip()]


def _frame_lines(numbers: Sequence[int], different: Mapping[str, int]) -> list[str]:
    """The frames, and the buffers of which they need as many different ones."""
    count = (
        f"{len(numbers)} from {numbers[0]} to {numbers[-1]}, this is the plan of the first; different buffers"
    )
    counts = {
        f"{times:5} x": [name for name, each in different.items() if each == times]
        for times in sorted(set(different.values()))
    }
    return [_row("frames", [count]), *(_row(head, names) for head, names in counts.items())]


def _row(head: str, names: Sequence[str]) -> str:
    if not names:
        return ""
    return textwrap.fill(", ".join(names), 100, initial_indent=f"{head:8}", subsequent_indent=" " * 8)
