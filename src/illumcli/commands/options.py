"""What is to be rendered, and how: the units of work of `render` and `sweep`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

from illumcli.records import Value


class RenderOptions(Value):
    """What scenes are rendered with."""

    overrides: tuple[str, ...] = ()
    """`PATH=VALUE`, as `-D` gives them."""
    pattern: str | None = None
    """Names of the files; by default those of the scene."""
    only: tuple[str, ...] = ()
    """Layers; by default those of the scene."""
    seed: int | None = None
    threads: int | None = None
    """By default one per core."""
    force: bool = False
    """Replace files that differ, write those that do not anew."""
    cache: bool = True
    """Use what earlier runs kept, and keep what later runs may use; the files are the same."""
    strict: bool = False
    """Refuse meshes and textures that need repairs."""
    keep_going: bool = True
    """Go on with other scenes or variants after one that failed."""
    audit: bool = True
    """State the error of what is reconstructed."""
    target_error: float | None = None
    """RMSE that sample counts are chosen for; by default the scene's counts."""


class RenderJob(Value):
    """One scene with its overrides: the unit of work. It can be pickled, and sent to another process."""

    scene: Path
    options: RenderOptions = RenderOptions()
    fields: Mapping[str, Any] = field(default_factory=dict)
    """More fields of the names of its files, as `frame`."""
