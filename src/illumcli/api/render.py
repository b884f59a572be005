"""Render scenes into arrays."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from threading import Lock
from typing import Any, TypedDict, Unpack, overload

from illumcli.api.pictures import Rendering
from illumcli.api.scenes import AnyScene, Overrides, file_of, named_scene, override_texts, without_folder
from illumcli.commands.held_images import HeldImages
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.unit import Worker
from illumcli.commands.unused import unused_keys
from illumcli.progress import Progress, no_progress
from illumcli.scene.frames import frame_numbers


class Options(TypedDict, total=False):
    """How a scene is rendered; each is the option of ``illum render`` of the same name."""

    layers: Sequence[str] | str
    """Names of layers, as `--only`; by default those of the scene."""
    seed: int
    threads: int
    target_error: float
    """RMSE that sample counts are chosen for; by default the scene's counts."""
    cache: bool
    """False to neither read nor keep buffers on disk."""
    strict: bool
    """True to refuse meshes and textures that need repairs."""
    progress: Progress
    """Called with the camera's name, the pixels done, and all of them."""


class LoadedScene:
    """A scene to render several times; buffers that no override touches are computed once.

    Its text and its files are read when they are first needed; load it again when they change. Threads that
    render it take turns.

    Parameters
    ----------
    scene : path, mapping or Scene
        A scene or mesh file; or the keys of a scene, in which a mesh may be a mapping with arrays `vertices`
        and `faces`, or an object that has both, such as trimesh's. Its paths start in the current folder.
    """

    def __init__(self, scene: AnyScene) -> None:
        # The folder of a scene, and of meshes, that are no files.
        self._folder = Path(tempfile.mkdtemp(prefix="illum-"))
        weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        self.path = file_of(scene, self._folder)
        """The scene file."""
        self._lock = Lock()
        self._images = HeldImages()
        self._worker = Worker(self._images)

    def render(
        self, overrides: Overrides = (), frame: int | None = None, **options: Unpack[Options]
    ) -> Rendering:
        """The pictures of all cameras, with overrides, at a frame; by default the scene's first.

        Raises
        ------
        IllumError
            What ``illum render`` would say.
        """
        given: dict[str, Any] = dict(options)
        progress = given.pop("progress", no_progress)
        layers = given.pop("layers", ())
        given["only"] = (layers,) if isinstance(layers, str) else tuple(layers)
        with self._lock, named_scene(self._folder):
            texts = override_texts(overrides, self._folder)
            chosen = RenderOptions(overrides=texts, pattern="{camera}.exr", force=True, **given)
            work = self._worker.prepare(RenderJob(self.path, chosen, frame))
            self._images.images.clear()
            _, report = self._worker.run(work, progress)
            report = replace(report, warnings=(*report.warnings, *unused_keys(work), *self._worker.finish()))
            facts = without_folder(replace(report, written=(), kept=()).as_data(), self._folder)
            return Rendering.of(self._images.images, facts)


def load(scene: AnyScene) -> LoadedScene:
    """A scene to render several times; what overrides do not touch is computed once.

    Examples
    --------
    >>> teapot = illum.load("scenes/teapot.yaml")
    >>> for exponent in (20, 90, 400):
    ...     teapot.render({"materials.glaze.exponent": exponent}).save(f"glaze-{exponent}.png")
    """
    return LoadedScene(scene)


@overload
def render(scene: AnyScene, overrides: Overrides = (), **options: Unpack[Options]) -> Rendering: ...
@overload
def render(
    scene: AnyScene, overrides: Overrides = (), *, frames: str | Iterable[int], **options: Unpack[Options]
) -> list[Rendering]: ...
def render(
    scene: AnyScene,
    overrides: Overrides = (),
    *,
    frames: str | Iterable[int] | None = None,
    **options: Unpack[Options],
) -> Rendering | list[Rendering]:
    """Render a scene into arrays; nothing is written.

    Parameters
    ----------
    scene : path, mapping or Scene
        As `load` takes it.
    overrides : mapping or sequence of str
        ``{"materials.clay.sigma": 0.3}``, or the texts of `-D`.
    frames : str or iterable of int, optional
        Frames of an animation: `FIRST:LAST`, `FIRST:LAST:STEP`, or numbers; a list of renderings comes back.
    options
        See `Options`.

    Raises
    ------
    IllumError
        What ``illum render`` would say.

    Examples
    --------
    >>> picture = illum.render("scenes/teapot.yaml", {"film.width": 320}, layers=["beauty", "depth"])
    >>> picture["depth"].shape
    (720, 320, 1)
    """
    loaded = LoadedScene(scene)
    if frames is None:
        return loaded.render(overrides, **options)
    numbers = frame_numbers(frames) if isinstance(frames, str) else frames
    return [loaded.render(overrides, number, **options) for number in numbers]
