"""The report of a render."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, fields, replace
from typing import Any

from illumcli import __version__
from illumcli.files.reports import sealed_json
from illumcli.geometry.repairs import Repairs
from illumcli.memory import peak_memory
from illumcli.rays.ray_loop import ray_loop_name
from illumcli.records import Value
from illumcli.render_graph.repairs import repairs_data
from illumcli.render_graph.tile_nodes import RenderStats
from illumcli.versions import versions


class Report(Value):
    """What a render did: files, repairs, times, counts, errors."""

    scene: str
    scene_hash: str
    seed: int
    threads: int
    written: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()
    skipped: Mapping[str, str] = field(default_factory=dict)
    repairs: Repairs = field(default_factory=dict)
    seconds: Mapping[str, float] = field(default_factory=dict)
    rays: Mapping[str, int] = field(default_factory=dict)
    ray_loop: str | None = None
    """Name of the loop that traced the rays; None if no ray was traced."""
    saved: Mapping[str, int] = field(default_factory=dict)
    """Avoided work: points that a light does not reach (`incident`) or that are in its shadow (`unshadowed`),
    polygons of culled objects, samples that adaptive sampling left out."""
    refined: int = 0
    """Pixels that adaptive antialiasing gave all samples."""
    reused: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    """Camera -> buffer -> where it was loaded from: `memory` or `store`."""
    warnings: tuple[str, ...] = ()
    clamped: int = 0
    error: Mapping[str, float] = field(default_factory=dict)
    """The target error, the error reached, and the sample counts; empty without a target."""
    chosen: tuple[str, ...] = ()
    """The overrides with these counts."""
    standard_error: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Camera -> mean and root mean square of its layer `error`, if that was rendered."""
    audited_error: Mapping[str, Mapping[str, str | float]] = field(default_factory=dict)
    """Camera -> RMSE of its layer with reconstructed obscurance, from rays that are used nowhere else."""
    total_seconds: float = 0.0

    def with_counts(self, stats: RenderStats) -> Report:
        """The report with the counts of a run."""
        return replace(
            self,
            seconds=dict(stats.seconds),
            rays=dict(stats.rays),
            saved=dict(stats.saved),
            refined=stats.refined,
            ray_loop=ray_loop_name() if any(stats.rays.values()) else None,
        )

    def sharing(self, other: Report | None) -> Report:
        """This report, without memory of its own for what it says just as another does."""
        equal = {
            part.name: getattr(other, part.name)
            for part in fields(self)
            if other is not None and getattr(self, part.name) == getattr(other, part.name)
        }
        return replace(self, **equal)

    def as_data(self) -> dict[str, Any]:
        """The report for JSON, with versions and peak memory."""
        data = {part.name: getattr(self, part.name) for part in fields(self)} | repairs_data(self.repairs)
        return {"illum": __version__, **data, "peak_memory_bytes": peak_memory(), "versions": versions()}


def report_text(entries: Sequence[Mapping[str, Any]]) -> str:
    """One entry, or a list of several, as JSON. Each has its `content`, the first one the file's hash."""
    return sealed_json(entries, in_a_list=len(entries) > 1)
