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

from illumcli.api.choices import RenderChoices, chosen, plain_number
from illumcli.api.pictures import Rendering
from illumcli.api.scenes import AnyScene, Overrides, file_of, named_scene, override_texts, without_folder
from illumcli.commands.held_images import HeldImages
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render_jobs import overrides_at
from illumcli.commands.unit import Worker
from illumcli.commands.unused import unused_keys
from illumcli.commands.work import Work
from illumcli.errors import InputError
from illumcli.progress import Progress, no_progress
from illumcli.render_graph.limits import refuse_memory
from illumcli.scene.frames import FRAMES_PER_SECOND, frame_numbers
from illumcli.scene.load import read_frames


class Options(TypedDict, total=False):
    """How a scene is rendered; each is the option of ``illum render`` of the same name."""

    layers: Sequence[str] | str
    """Names of layers, as `--only`; by default those of the scene."""
    seed: int
    """Of random numbers; by default the scene's."""
    threads: int
    """By default one per core."""
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
    scene : path-like, mapping, Scene or mesh
        A scene or mesh file; or the keys of a scene, whose paths start in the current folder. A mesh, here
        or in a scene, is a mapping with arrays `vertices` and `faces`, or an object that has both, such as
        trimesh's.
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

    def __repr__(self) -> str:
        return f"<scene {without_folder(str(self.path), self._folder)}>"

    def __reduce__(self) -> str:
        raise TypeError("a loaded scene stays in its process; load it in each")

    def render(
        self, overrides: Overrides = (), frame: int | None = None, **options: Unpack[Options]
    ) -> Rendering:
        """The pictures of all cameras, with overrides, at a frame; by default the scene's first.

        Parameters
        ----------
        overrides : mapping or sequence of str
            ``{"materials.clay.sigma": 0.3}``, or the texts of `-D`; at a frame these may be formulas of
            `frame` and `time`.
        frame : int, optional
            Of an animation.
        options
            See `Options`.

        Raises
        ------
        IllumError
            What ``illum render`` would say.
        """
        progress = options.get("progress", no_progress)
        with self._lock, named_scene(self._folder):
            return self._rendered(self._prepared(overrides, frame, options), progress)

    def variants(self, overrides: Sequence[Overrides], **options: Unpack[Options]) -> list[Rendering]:
        """The pictures with each of several overrides; faults of all are found before the first ray.

        Raises
        ------
        IllumError
            What `render` would say of each.
        """
        progress = options.get("progress", no_progress)
        with self._lock, named_scene(self._folder):
            works: list[Work] = []
            problems: list[str] = []
            for each in overrides:
                try:
                    works.append(self._prepared(each, None, options))
                except InputError as error:
                    problems += error.problems
            if problems:
                raise InputError(dict.fromkeys(problems))
            refuse_too_many(works)
            return [self._rendered(work, progress) for work in works]

    def _prepared(self, overrides: Overrides, frame: int | None, options: Options) -> Work:
        """What is to be rendered; no ray is cast."""
        given = chosen(RenderChoices, {**options, "progress": None}, ("layers",))
        texts = override_texts(overrides, self._folder)
        if frame is not None:
            frames = read_frames(self.path, texts, self._worker.shared(self.path).text)
            texts = overrides_at(texts, frame, frames.fps if frames else FRAMES_PER_SECOND)
        taken = RenderOptions(
            texts,
            "{camera}.exr",
            tuple(given.layers),
            given.seed,
            given.threads,
            force=True,
            cache=given.cache,
            strict=given.strict,
            target_error=given.target_error,
        )
        return self._worker.prepare(RenderJob(self.path, taken, frame))

    def _rendered(self, work: Work, progress: Progress) -> Rendering:
        self._images.images.clear()
        _, report = self._worker.run(work, progress)
        report = replace(report, warnings=(*report.warnings, *unused_keys(work), *self._worker.finish()))
        facts = without_folder(replace(report, written=(), kept=()).as_data(), self._folder)
        return Rendering.of(self._images.images, facts)


def refuse_too_many(works: Sequence[Work]) -> None:
    """Raise LimitError if memory cannot hold the pictures of all works at once."""
    for work in works[:1]:
        for target in work.targets:
            values = len(work.development.channels(target))
            rows = target.height * len(works)
            refuse_memory(rows, target.view.width, values, {}, f"{len(works)} variants")


def load(scene: AnyScene) -> LoadedScene:
    """A scene to render several times; what overrides do not touch is computed once.

    Parameters
    ----------
    scene : path-like, mapping, Scene or mesh
        As `LoadedScene` takes it.

    Raises
    ------
    InputError
        It is none of these, or a mapping has a value that no scene can have.

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
    scene: AnyScene,
    overrides: Overrides = (),
    *,
    frames: str | int | Iterable[int],
    **options: Unpack[Options],
) -> list[Rendering]: ...
def render(
    scene: AnyScene,
    overrides: Overrides = (),
    *,
    frames: str | int | Iterable[int] | None = None,
    **options: Unpack[Options],
) -> Rendering | list[Rendering]:
    """Render a scene into arrays; nothing is written.

    Parameters
    ----------
    scene : path-like, mapping, Scene or mesh
        As `load` takes it.
    overrides : mapping or sequence of str
        ``{"materials.clay.sigma": 0.3}``, or the texts of `-D`.
    frames : str, int or iterable of int, optional
        Frames of an animation: `FIRST:LAST`, `FIRST:LAST:STEP`, or numbers.
    options
        See `Options`.

    Returns
    -------
    Rendering or list of Rendering
        The pictures of all cameras; with `frames`, those of each frame.

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
    numbers = frame_numbers(frames) if isinstance(frames, str) else _numbers(frames)
    return [loaded.render(overrides, number, **options) for number in numbers]


def _numbers(frames: Any) -> list[int]:
    """Numbers of frames.

    Raises
    ------
    InputError
        They are none.
    """
    plain = [plain_number(each) for each in (frames if isinstance(frames, Iterable) else [frames])]
    for each in plain:
        if isinstance(each, bool) or not isinstance(each, int) or each < 0:
            raise InputError(f"frames: must be whole numbers, at least 0, or text as 0:47, is {each!r}")
    return plain
