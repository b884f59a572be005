"""Explain a scene's plan."""

from __future__ import annotations

import json
import textwrap
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from illumcli.plan.plan import Plan, plan
from illumcli.scene.load import load


def run(path: Path, overrides: Sequence[str] = (), only: Sequence[str] = (), as_json: bool = False) -> str:
    """The plan of a scene as a table, or as JSON."""
    loaded = load(path, overrides)
    made = plan(loaded.scene, loaded, only)
    return json.dumps(made.as_data(), indent=1) if as_json else table(made)


def table(made: Plan) -> str:
    """The plan in words: what runs once, what per tile, what does not and why."""
    lines = [
        *(f"view    {v.name}: {v.width} x {v.height}, {v.samples} samples per pixel" for v in made.views),
        _row("layers", [layer.name for layer in made.layers]),
        _row("once", [step.makes for step in made.once]),
        _row("tile", [step.makes for step in made.tile]),
        _row("rays", [f"{name} {count:,}" for name, count in made.expected_rays.items()]),
    ]
    reasons = defaultdict(list)
    for name, why in made.skipped.items():
        reasons[why].append(name)
    for why, names in reasons.items():
        lines.append(_row("unused", names) + f"\n          ({why})")
    return "\n".join(lines)


def _row(head: str, names: Sequence[str]) -> str:
    return textwrap.fill(", ".join(names), 100, initial_indent=f"{head:8}", subsequent_indent=" " * 8)
