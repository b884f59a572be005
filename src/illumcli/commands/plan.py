"""Explain a scene's plan."""

from __future__ import annotations

import json
import textwrap
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from illumcli.commands.render import opened_store
from illumcli.render_graph.cached import Artifacts
from illumcli.render_graph.culling import unseen_objects, why_all, without
from illumcli.render_graph.execute import RenderStats
from illumcli.render_graph.framing import framed
from illumcli.render_graph.limits import expected_memory, refuse_memory
from illumcli.render_graph.schedule import Plan, plan, reusing
from illumcli.scene.load import load


def run(
    path: Path,
    overrides: Sequence[str] = (),
    only: Sequence[str] = (),
    as_json: bool = False,
    cache: bool = True,
) -> str:
    """The plan of a scene as a table, or as JSON; with `cache` for what the store holds now."""
    loaded = load(path, overrides)
    made = plan(loaded.scene, loaded, only)
    store = opened_store() if cache else None
    made = framed(made, Artifacts(store), RenderStats(), at_hand=True)
    numbers = unseen_objects(made, Artifacts(store), RenderStats(), at_hand=True)
    made = replace(without(made, loaded, numbers), objects=objects(made, numbers))
    parts = [reusing(made, view, Artifacts(store, look=True)) for view in made.views]
    expected = expected_memory(loaded, loaded.scene)
    if as_json:
        return json.dumps([data_of(part, expected) for part in parts], indent=1)
    return table(parts, expected)


def refuse_too_large(path: Path, overrides: Sequence[str] = ()) -> None:
    """Raise LimitError where memory cannot hold the scene's shapes, meshes and textures."""
    loaded = load(path, overrides)
    refuse_memory(0, 0, 0, expected_memory(loaded, loaded.scene), str(path))


def data_of(part: Plan, expected: Mapping[str, int]) -> dict[str, Any]:
    """A plan as JSON has it, with what shapes, mesh files and textures are expected to take."""
    data = part.as_data()
    return data | {"expected_bytes": {**expected, **data["expected_bytes"]}}


def objects(made: Plan, left_out: tuple[int, ...]) -> str:
    """Which objects take part, and why."""
    why = why_all(made)
    if why is not None:
        return f"all: {why}"
    if left_out:
        return f"all but {len(left_out)} that no view can tell"
    return "known once the meshes are read, or all are needed"


def table(parts: Sequence[Plan], expected: Mapping[str, int] | None = None) -> str:
    """Plans in words, one per view: what runs once, what per tile, what does not and why; and what shapes,
    mesh files and textures are `expected` to take [bytes]."""
    return "\n\n".join("\n".join(_lines(part, expected or {})) for part in parts)


def _lines(made: Plan, expected: Mapping[str, int]) -> list[str]:
    view = made.views[0]
    memory = {**expected, **made.expected_bytes()}
    lines = [
        f"view    {view.name}: {view.width} x {view.height}, {view.samples} samples per pixel"
        + (f", {view.adaptive.first} where these agree" if view.is_adaptive else ""),
        f"objects {made.objects}",
        _row("layers", [layer.name for layer in made.layers]),
        _row("once", [step.output for step in made.once if step.output not in made.reused]),
        _row("tile", [step.output for step in made.tile if step.output not in made.reused]),
        _row("reused", list(made.reused)),
        _row("rays", [f"{name} {count:,}" for name, count in made.expected_rays.items()]),
        _row("memory", [f"{name} {size / 2**20:,.1f} MiB" for name, size in memory.items()]),
    ]
    reasons = defaultdict(list)
    for name, why in made.skipped.items():
        reasons[why].append(name)
    for why, names in reasons.items():
        lines.append(_row("unused", names) + f"\n          ({why})")
    return [line for line in lines if line.strip()]


def _row(head: str, names: Sequence[str]) -> str:
    if not names:
        return ""
    return textwrap.fill(", ".join(names), 100, initial_indent=f"{head:8}", subsequent_indent=" " * 8)
