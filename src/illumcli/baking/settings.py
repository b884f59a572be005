"""Settings and options of a bake."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

from illumcli.records import Value
from illumcli.scene.faults import validated
from illumcli.scene.spec import Obscurance


class BakeSettings(Value):
    """Everything that baked values and files depend on, apart from the meshes and their places."""

    samples: int = 256  # rays per vertex or texel
    target_error: float | None = None  # root mean square over all vertices or texels, instead of `samples`
    reconstruct: bool = False  # values of few rays from those around, with an audited error
    falloff: Mapping[str, Any] = field(default_factory=lambda: {"falloff": "step"})  # as scenes have it
    sampler: str = "spiral"
    faces: str = "count"  # back faces: occlude (`count`), are transparent (`ignore`), end rays (`one_sided`)
    method: str = "vertex"  # or `fit`: least squares over the surface
    occluders: tuple[str, ...] = ("scene",)  # as `occluder_choices` takes them
    ground: str | None = None  # as `Ground.of` takes it
    what: tuple[str, ...] = ("ao",)  # words of `--what`, in the order of `channels.whats`
    color: str | None = None  # of `COLOR_CHANGES`
    split: bool = False  # vertices of a PLY
    texture: tuple[int, int] | None = None  # width and height of textures [texels]
    bits: int = 8  # of textures as PNG
    unwrap: str | None = None  # make uv for objects that have none (`missing`), or for all (`all`)
    seed: int = 0

    @property
    def beyond_fit(self) -> str | None:
        """The first of these settings that the method `fit` does not have; None if it has all."""
        settings = {
            "target_error": self.target_error is not None,
            "reconstruct": self.reconstruct,
            "what": self.what != ("ao",),
        }
        return next((name for name, is_beyond in settings.items() if is_beyond), None)

    def obscurance(self) -> Obscurance:
        """The settings as a scene describes them.

        Raises
        ------
        InputError
            Values that no scene may have.
        """
        tree = {
            "samples": self.samples,
            "falloff": dict(self.falloff),
            "sampler": self.sampler,
            "faces": self.faces,
        }
        return validated(Obscurance, tree)

    def as_data(self) -> dict[str, Any]:
        """The settings for JSON."""
        lists = {"occluders": list(self.occluders), "what": list(self.what)}
        return {**vars(self), "falloff": dict(self.falloff), **lists}


class BakeOptions(Value):
    """How inputs are read, computed and written."""

    overrides: tuple[str, ...] = ()
    """`PATH=VALUE` for scenes, as `-D` gives them."""
    threads: int | None = None
    """Number of threads; by default one per core."""
    force: bool = False
    """Replace files that differ."""
    strict: bool = False
    """Refuse meshes that need repairs."""


AS_USUAL = BakeOptions()


class BakeJob(Value):
    """One input of a bake with its settings, a unit of work: see `commands/unit.py`."""

    path: Path
    outputs: tuple[Path, ...]
    settings: BakeSettings
    options: BakeOptions = AS_USUAL
    preview: Path | None = None
    """The picture of the result, if one is wanted."""

    @property
    def previews(self) -> tuple[Path, ...]:
        """The preview, if there is one."""
        return () if self.preview is None else (self.preview,)

    @property
    def threads(self) -> int:
        """Number of threads."""
        return self.options.threads or len(os.sched_getaffinity(0))
