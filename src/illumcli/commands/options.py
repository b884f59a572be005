"""Options and jobs of `render`, `sweep` and `ao-bake`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

from illumcli.records import Value


class Shard(Value):
    """One of `count` parts of the units of a command."""

    number: int
    """From 1."""
    count: int

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"


class RenderOptions(Value):
    """Options that scenes are rendered with."""

    overrides: tuple[str, ...] = ()
    """`PATH=VALUE`, as `-D` gives them."""
    pattern: str | None = None
    """Pattern of the files' names; by default those of the scene."""
    only: tuple[str, ...] = ()
    """Names of layers; by default those of the scene."""
    seed: int | None = None
    threads: int | None = None
    """Number of threads; by default one per core."""
    force: bool = False
    """Replace files that differ, and write equal ones anew."""
    cache: bool = True
    """Load buffers that earlier runs kept, and keep buffers for later runs; the files are the same."""
    strict: bool = False
    """Refuse meshes and textures that need repairs."""
    keep_going: bool = True
    """Go on with other scenes or variants after one that failed."""
    audit: bool = True
    """Measure the error of reconstructed layers."""
    audit_precision: float | None = None
    """Relative standard error of the measured error; by default the audit's own."""
    target_error: float | None = None
    """RMSE that sample counts are chosen for; by default the scene's counts."""
    frames: str | None = None
    """`FIRST:LAST` or `FIRST:LAST:STEP`, the frames to render; by default those of the scene."""
    shard: Shard | None = None
    """The part of all units that is rendered; by default all."""


class RenderFiles(Value):
    """The files to write about all scenes and frames of `illum render`."""

    report: Path | None = None
    html: Path | None = None
    """Folder of a report for a browser."""


class RenderJob(Value):
    """One scene with its options, a unit of work: see `commands/unit.py`."""

    scene: Path
    options: RenderOptions = RenderOptions()
    frame: int | None = None
    """The frame of an animation; by default the scene's first, or none."""
    cameras: tuple[str, ...] = ()
    """Names of the cameras whose images are rendered; by default all."""
    rows: tuple[int, int] | None = None
    """The rows of these images that are rendered, into files of their own; by default all."""
    fields: Mapping[str, Any] = field(default_factory=dict)
    """Further fields for the names of its files."""
