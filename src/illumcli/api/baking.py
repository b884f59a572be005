"""Bake obscurance and other channels into arrays."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypedDict, Unpack

from numpy.typing import NDArray

from illumcli.api.choices import BakeChoices, chosen, plain_number
from illumcli.api.scenes import AnyScene, Overrides, file_of, named_scene, override_texts, without_folder
from illumcli.errors import InputError
from illumcli.progress import Progress, no_progress
from illumcli.records import Record
from illumcli.schema.messages import suggestion
from illumcli.visibility.baked import read_npz
from illumcli.visibility.channels import whats


class BakeKeywords(TypedDict, total=False):
    """How a mesh is baked; each is the option of ``illum ao-bake`` of the same name."""

    samples: int
    """Rays per vertex, by default 256."""
    target_error: float
    """RMSE that the rays are chosen for, instead of `samples`."""
    reconstruct: bool
    """Values of few rays from those around; by default with a `target_error`."""
    falloff: str | Mapping[str, Any]
    """A name, or keys as ``{"falloff": "exponential", "tau": 2}``, which are those of `obscurance.falloff` in
    scenes; by default `step`."""
    sampler: str
    """`spiral`, by default, `owen` or `random`."""
    faces: str
    """Back faces occlude, `count`, by default; are transparent, `ignore`; or end the ray, `one_sided`."""
    method: str
    """`vertex`, by default, or `fit`, by least squares to samples of the surface."""
    occluders: Sequence[str] | str
    """What occludes an object beside itself, by default `scene`; others as of `--occluders`."""
    ground: str
    """The axis that points up from a ground plane below the mesh, such as `y`; more by `--ground`."""
    what: Sequence[str] | str
    """`ao`, by default, `bent_normal` and `thickness`."""
    color: str
    """What obscurance does to vertex colours of the outputs; by default nothing."""
    split: bool
    """True to split vertices with several normals, uv or values in a `.ply`, too."""
    texture: int | tuple[int, int]
    """Width and height; one number for both."""
    bits: int
    """Of textures as `.png`, 8, by default, or 16."""
    unwrap: str
    """`missing` or `all`, the objects that get new uv for textures."""
    seed: int
    """Of random numbers, by default 0."""
    threads: int
    """By default one per core."""
    strict: bool
    """True to refuse meshes that need repairs."""


class Baking(Record):
    """Baked values at the vertices of a mesh, in the order of its file; of a scene, object after object."""

    channels: Mapping[str, NDArray[Any]]
    """(V,) or (V, 3) float32 by name, `obscurance`, `standard_error` and what `what` asks for."""
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
    outputs: Sequence[str | os.PathLike[str]] | str | os.PathLike[str] = (),
    *,
    overrides: Overrides = (),
    force: bool = False,
    progress: Progress = no_progress,
    **keywords: Unpack[BakeKeywords],
) -> Baking:
    """Bake a mesh, or all meshes of a scene, into arrays, and into files if any are named.

    Parameters
    ----------
    mesh : path-like, mapping, Scene or mesh
        A mesh or scene file, a scene as `load` takes it, or a mesh: a mapping with arrays `vertices` and
        `faces`, or an object that has both, such as trimesh's.
    outputs : path-like or sequence of path-like
        Files as `-o` of ``illum ao-bake`` names them.
    overrides : mapping or sequence of str
        Of a scene, as `render` takes them.
    force : bool
        Replace files that differ.
    progress : callable
        Called with a name, the amount done, and all of it.
    keywords
        See `BakeKeywords`.

    Returns
    -------
    Baking
        The values, and the report.

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

    size = plain_number(keywords.get("texture"))
    both = {"texture": (size, size)} if isinstance(size, int) else {}
    given = chosen(BakeChoices, {**keywords, **both}, ("occluders", "what"))
    settings = BakeSettings(**_settings(given))
    if settings.method == "fit" and settings.beyond_fit is not None:
        raise InputError(f"{settings.beyond_fit} works with method='vertex'; leave it out, or the method")
    named = (outputs,) if isinstance(outputs, str | os.PathLike) else outputs
    with tempfile.TemporaryDirectory(prefix="illum-") as folder:
        own = Path(folder)
        path = file_of(mesh, own)
        values, files = own / "values.npz", tuple(map(Path, named))
        with named_scene(own):
            texts = override_texts(overrides, own)
            options = BakeOptions(texts, given.threads, force, given.strict)
            _, report = bake_mesh(path, (values, *files), settings, options, progress)
        baked = read_npz(values)
    written = [name for name in report.as_data()["written"] if name != str(values)]
    facts = without_folder({**report.as_data(), "written": written}, own)
    return Baking(baked.channels, baked.corner_channels, facts, files)


def _settings(given: BakeChoices) -> dict[str, Any]:
    """The fields of `BakeSettings`.

    Raises
    ------
    InputError
        Options that exclude each other, or an unknown channel.
    """
    if given.samples is not None and given.target_error is not None:
        raise InputError("samples and target_error exclude each other; give one")
    unknown = [word for word in given.what if word not in whats()]
    if unknown:
        raise InputError(f"what: no '{unknown[0]}'; {suggestion(unknown[0], whats())}")
    falloff = {"falloff": given.falloff} if isinstance(given.falloff, str) else given.falloff
    is_reconstructed = given.target_error is not None if given.reconstruct is None else given.reconstruct
    settings = {
        name: value for name, value in given if value is not None and name not in ("threads", "strict")
    }
    return {
        **settings,
        "reconstruct": is_reconstructed,
        "falloff": falloff,
        "occluders": tuple(given.occluders),
        "what": tuple(word for word in whats() if word in given.what),
    }
