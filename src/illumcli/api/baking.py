"""Bake obscurance and other channels into arrays."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from illumcli.api.scenes import AnyScene, file_of, named_scene, without_folder
from illumcli.progress import Progress, no_progress
from illumcli.records import Record
from illumcli.visibility.baked import read_npz


class BakeKeywords(TypedDict, total=False):
    """How a mesh is baked; each is the option of ``illum ao-bake`` of the same name."""

    samples: int
    """Rays per vertex."""
    target_error: float
    reconstruct: bool
    falloff: str | Mapping[str, Any]
    """A name, or the keys of `obscurance.falloff` in scenes: ``{"falloff": "exponential", "tau": 2}``."""
    sampler: str
    faces: str
    method: str
    occluders: Sequence[str]
    ground: str
    what: Sequence[str]
    color: str
    split: bool
    texture: tuple[int, int]
    bits: int
    unwrap: str
    seed: int


class Baking(Record):
    """Baked values at the vertices of a mesh, in the order of its file; of a scene, object after object."""

    channels: Mapping[str, NDArray[Any]]
    """Name -> (V,) or (V, 3) float32: `obscurance`, `standard_error` and what `what` asks for."""
    corner_channels: Mapping[str, NDArray[Any]]
    """The same at corners, polygon by polygon; empty if each vertex has one value."""
    report: dict[str, Any]
    """What `--report` of ``illum ao-bake`` writes."""
    files: tuple[Path, ...]
    """The outputs that were asked for."""

    def __repr__(self) -> str:
        shapes = ", ".join(f"{name} {each.shape}" for name, each in self.channels.items())
        return f"<baking of {self.report['vertices']:,} vertices: {shapes}>"

    @property
    def obscurance(self) -> NDArray[Any]:
        """(V,) float32, 1 where open."""
        return self.channels["obscurance"]

    @property
    def standard_error(self) -> NDArray[Any]:
        """(V,) float32, of `obscurance`."""
        return self.channels["standard_error"]


def bake(
    mesh: AnyScene,
    outputs: Sequence[str | os.PathLike[str]] = (),
    *,
    force: bool = False,
    progress: Progress = no_progress,
    **keywords: Unpack[BakeKeywords],
) -> Baking:
    """Bake a mesh, or all meshes of a scene, into arrays, and into files if any are named.

    Parameters
    ----------
    mesh : path, mapping, Scene or mesh
        A mesh or scene file, a scene as `load` takes it, or a mesh: a mapping with arrays `vertices` and
        `faces`, or an object that has both, such as trimesh's.
    outputs : sequence of path
        Files as `-o` of ``illum ao-bake`` names them.
    force : bool
        Replace files that differ.
    keywords
        See `BakeKeywords`.

    Raises
    ------
    IllumError
        What ``illum ao-bake`` would say.

    Examples
    --------
    >>> illum.bake("bunny.obj", samples=64).obscurance.mean()
    """
    from illumcli.baking.bake import bake_mesh
    from illumcli.baking.settings import BakeOptions, BakeSettings

    given: dict[str, Any] = {
        name: each.item() if isinstance(each, np.generic) else each for name, each in keywords.items()
    }
    if isinstance(falloff := given.get("falloff"), str):
        given["falloff"] = {"falloff": falloff}
    given |= {name: tuple(given[name]) for name in ("occluders", "what") if name in given}
    with tempfile.TemporaryDirectory(prefix="illum-") as folder:
        own = Path(folder)
        path = file_of(mesh, own)
        values, files = own / "values.npz", tuple(map(Path, outputs))
        settings = BakeSettings(**given)
        with named_scene(own):
            _, report = bake_mesh(path, (values, *files), settings, BakeOptions(force=force), progress)
        baked = read_npz(values)
    written = [name for name in report.as_data()["written"] if name != str(values)]
    facts = without_folder({**report.as_data(), "written": written}, own)
    return Baking(baked.channels, baked.corner_channels, facts, files)
