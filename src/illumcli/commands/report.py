"""The report of a render."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, fields, replace
from typing import Any

from illumcli import __version__
from illumcli.files.reports import sealed_json
from illumcli.geometry.repairs import Repair, Repairs
from illumcli.memory import peak_memory
from illumcli.rays.ray_loop import ray_loop_name
from illumcli.records import Value
from illumcli.render_graph.repairs import repairs_data
from illumcli.render_graph.tile_nodes import RenderStats
from illumcli.versions import versions

OF_PROCESS = ("illum", "peak_memory_bytes", "versions")
"""What the data of a report say of the process."""


class Report(Value):
    """What a render did: files, repairs, times, counts, errors."""

    scene: str
    scene_hash: str
    seed: int
    threads: int
    written: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()
    skipped: Mapping[str, str] = field(default_factory=dict)
    whole: str = ""
    """Why its pictures are not cut into bands for several workers; empty if large ones are."""
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
    obscurance_files: Mapping[str, str] = field(default_factory=dict)
    """Object -> the file that its obscurance is read from: it cast no obscurance rays."""
    warnings: tuple[str, ...] = ()
    clamped: int = 0
    mended: Mapping[str, int] = field(default_factory=dict)
    """Material -> values that its formula or class gave as negative or not finite, and that are 0."""
    error: Mapping[str, float] = field(default_factory=dict)
    """The target error, the error reached, and the sample counts; empty without a target."""
    chosen: tuple[str, ...] = ()
    """The overrides with these counts."""
    standard_error: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Camera -> mean and root mean square of its layer `error`, if that was rendered."""
    audited_error: Mapping[str, Mapping[str, str | float]] = field(default_factory=dict)
    """Camera -> RMSE of its layer with reconstructed obscurance, from rays that are used nowhere else."""
    total_seconds: float = 0.0
    process: Mapping[str, Any] = field(default_factory=dict, repr=False)
    """Versions and peak memory of the process that made it, if that is another one."""

    @classmethod
    def of_data(cls, data: Mapping[str, Any]) -> Report:
        """The report that was written as this data."""
        values: dict[str, Any] = {part.name: data[part.name] for part in fields(cls) if part.name in data}
        values |= {name: tuple(value) for name, value in values.items() if isinstance(value, list)}
        firsts = data["repairs_first"]
        values["repairs"] = {
            what: Repair(count, firsts.get(what, "")) for what, count in data["repairs"].items()
        }
        return cls(**values, process={name: data[name] for name in OF_PROCESS})

    def with_counts(self, stats: RenderStats) -> Report:
        """The report with the counts of a run."""
        return replace(
            self,
            seconds=dict(stats.seconds),
            rays=dict(stats.rays),
            saved=dict(stats.saved),
            refined=stats.refined,
            mended=dict(stats.mended),
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

    def joined(self, others: Sequence[Report]) -> Report:
        """One report of this one and those of other cameras of the same scene."""
        reports = (self, *others)

        def total(name: str) -> dict[str, Any]:
            keys = dict.fromkeys(key for report in reports for key in getattr(report, name))
            return {key: sum(getattr(report, name).get(key, 0) for report in reports) for key in keys}

        def union(name: str) -> dict[str, Any]:
            return {key: value for report in reports for key, value in getattr(report, name).items()}

        combined: dict[str, Any] = {name: total(name) for name in ("seconds", "rays", "saved", "mended")}
        combined |= {name: union(name) for name in ("repairs", "reused", "standard_error", "audited_error")}
        return replace(
            reports[-1],
            written=tuple(path for report in reports for path in report.written),
            kept=tuple(path for report in reports for path in report.kept),
            **combined,
            ray_loop=next((report.ray_loop for report in reports if report.ray_loop), None),
            warnings=tuple(dict.fromkeys(line for report in reports for line in report.warnings)),
            refined=sum(report.refined for report in reports),
            clamped=sum(report.clamped for report in reports),
            total_seconds=sum(report.total_seconds for report in reports),
        )

    def as_data(self) -> dict[str, Any]:
        """The report for JSON, with versions and peak memory."""
        names = [part.name for part in fields(self) if part.name != "process"]
        data = {name: getattr(self, name) for name in names} | repairs_data(self.repairs)
        process = self.process or dict(zip(OF_PROCESS, (__version__, peak_memory(), versions()), strict=True))
        return {"illum": process["illum"], **data, **process}


def report_text(entries: Sequence[Mapping[str, Any]]) -> str:
    """One entry, or a list of several, as JSON. Each has its `content`, the first one the file's hash."""
    return sealed_json(entries, in_a_list=len(entries) > 1)
