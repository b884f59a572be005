"""Plans as text."""

from __future__ import annotations

import textwrap
from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

SHOWN = 3
"""Stages that no earlier run had, and objects whose obscurance is baked, of which the names are shown."""


def plan_table(parts: Sequence[Mapping[str, Any]]) -> str:
    """Plans, one per view: what runs once, what runs per tile, what does not run and why."""
    return "\n\n".join("\n".join(_lines(part)) for part in parts)


def variants_table(parts: Sequence[Mapping[str, Any]]) -> str:
    """What all variants take, view by view; several views have their names."""
    heads = [[f"view    {part['views'][0]['camera']}"] if len(parts) > 1 else [] for part in parts]
    tables = [_lines_of_variants(part["variants"]) for part in parts]
    return "\n\n".join("\n".join([*head, *table]) for head, table in zip(heads, tables, strict=True))


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
        _row("baked", ["; ".join(_baked(part))] if part["obscurance_files"] else []),
        _row("memory", [f"{name} {size / 2**20:,.1f} MiB" for name, size in part["expected_bytes"].items()]),
        _row("whole", [f"on clusters and in shards: {part['whole']}"] if part["whole"] else []),
        _time_row(part["expected_time"]),
    ]
    reasons = defaultdict(list)
    for name, why in part["skipped"].items():
        reasons[why].append(name)
    for why, names in reasons.items():
        lines.append(_row("unused", names) + f"\n          ({why})")
    if "variants" in part:
        lines += _lines_of_variants(part["variants"])
    return [line for line in lines if line.strip()]


def _baked(part: Mapping[str, Any]) -> list[str]:
    """The files that obscurance is read from, with their objects."""
    objects = defaultdict(list)
    for name, file in part["obscurance_files"].items():
        objects[file].append(name)
    lines = []
    for file, names in objects.items():
        more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
        lines.append(f"{', '.join(names[:SHOWN])}{more}: obscurance from {file}, 0 rays")
    if lines and "hemispheres" in part["tile"]:
        lines.append("the scene's own settings are for the other objects")
    return lines


def _lines_of_variants(planned: Mapping[str, Any]) -> list[str]:
    """The variants, and the buffers of which they need as many different ones."""
    labels, files = planned["labels"], planned["files"]
    shard = [f"shard   {planned['shard']}, of {planned['of']} variants"] if "shard" in planned else []
    if not labels:
        return [*shard, "all     no variant"]
    kept = len(labels) - planned["due"]
    exist = f", {kept} of which exist" if kept else ""
    is_one = len(labels) == 1
    times = {
        f"{count:5} x ": [name for name, each in planned["times"].items() if each == count]
        for count in sorted(set(planned["times"].values()))
    }
    return [
        *shard,
        "all     "
        + ("1 variant" if is_one else f"{len(labels)} variants from {labels[0]} to {labels[-1]}")
        + exist,
        f"files   {files[0]}" + (f" to {files[-1]}, {len(files)} images" if len(files) > 1 else ""),
        *(_row(head, names) for head, names in times.items()),
        _row("rays", [f"{name} {count:,}" for name, count in planned["expected_rays"].items()]),
        _time_row(planned["expected_time"]),
    ]


def _time_row(time: Mapping[str, Any]) -> str:
    """The time that a plan is expected to take, and how that is known."""
    if not time["runs"]:
        return "time    unknown: no run has finished on this machine, or its cache is not read"
    unknown = time["unknown"]
    names = ", ".join(unknown[:SHOWN]) + (", ..." if len(unknown) > SHOWN else "")
    more = f", and more for what was never run here: {names}" if unknown else ""
    runs = f"{time['runs']} earlier runs" if time["runs"] > 1 else "an earlier run"
    return f"time    about {clock(time['seconds'])} by {runs} on this machine{more}"


def clock(seconds: float) -> str:
    """Seconds, minutes or hours."""
    if seconds < 60:
        return f"{seconds:.2g} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 120 else f"{minutes / 60:.1f} h"


def _row(head: str, names: Sequence[str]) -> str:
    if not names:
        return ""
    return textwrap.fill(", ".join(names), 100, initial_indent=f"{head:8}", subsequent_indent=" " * 8)
