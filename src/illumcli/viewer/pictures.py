"""Renders pictures of a scene with changing edits; what no edit touches is computed once."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.cache.recorder import Cache
from illumcli.commands.held_images import HeldImage, HeldImages
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.report import Report
from illumcli.commands.unit import Worker
from illumcli.commands.work import Work, work_of
from illumcli.images.jpeg import jpeg_bytes
from illumcli.progress import Progress
from illumcli.rays.viewpoints import Camera
from illumcli.records import Record
from illumcli.render_graph.execute import Run
from illumcli.render_graph.explain import expected_rays
from illumcli.render_graph.needs import layers
from illumcli.render_graph.pipeline import place_and_cull, plan_view
from illumcli.scene.load import load, read_text
from illumcli.scene.scene_file import SceneFile
from illumcli.schema.sources import folders
from illumcli.viewer.edits import overrides_of
from illumcli.viewer.quality import Coarse, Quality, scene_of, stage
from illumcli.viewer.saving import command_text, refuse_elsewhere, save
from illumcli.viewer.watching import Watch
from illumcli.viewer.window import Window

PICKED = ("object_id", "material_id")
"""Layers of whole pictures that say what is under the mouse."""
TRACED = ("obscurance", "raw_obscurance")
"""Buffers whose rays are those of obscurance."""
AUDIT_PRECISION = 0.1
"""Relative standard error of the stated error of a reconstructed picture that the full one follows: at the
renderer's own precision the audit takes as long as the picture."""
BEHIND = 36
"""Grey behind pictures with an alpha channel, of 255."""


class Picture(Record):
    """A picture of a window."""

    window: Window
    quality: Quality
    image: HeldImage
    report: Report
    seconds: float

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [pixels]."""
        return self.image.target.view.width, self.image.target.height

    @property
    def camera(self) -> Camera:
        """Its camera in its place, though the scene may only say what it fits."""
        return self.image.target.view.camera

    @property
    def rays(self) -> int:
        """The rays that were cast for it."""
        return sum(self.report.rays.values())

    @property
    def error(self) -> float | None:
        """Its root mean square error, where one was measured."""
        errors = self.report.audited_error.get(self.window.camera)
        return None if errors is None else float(errors["rmse"])

    @property
    def ray_seconds(self) -> float | None:
        """Seconds that each of its obscurance rays took; None if it cast none."""
        report = self.report
        names = [name for name in TRACED if report.rays.get(name)]
        rays, seconds = (sum(part[name] for name in names) for part in (report.rays, report.seconds))
        return seconds / rays / report.threads if rays else None

    def layers(self) -> dict[str, NDArray[Any]]:
        """Layer -> (H, W, C), as ``illum render`` writes them."""
        return self.image.layers()

    def channels(self, layer: str) -> list[str]:
        """The names of a layer's channels, without the layer's."""
        (chosen,) = (each for each in self.image.target.layers if each.name == layer)
        return [name.rpartition(".")[2] for name in self.image.work.development.names(chosen)]

    def pixels(self) -> NDArray[np.uint8]:
        """(H, W, 1 or 3), as a PNG shows the layer, in front of grey."""
        pixels = self.image.display(self.window.layer, self.layers())
        if pixels.shape[-1] not in (2, 4):
            return pixels
        colors, alpha = pixels[..., :-1], pixels[..., -1:]
        if (alpha == 255).all():
            return colors
        share = alpha.astype(np.float32) / 255
        return np.rint(colors * share + BEHIND * (1 - share)).astype(np.uint8)

    def jpeg(self) -> bytes:
        """The bytes that a browser shows."""
        return jpeg_bytes(self.pixels())


class Renderer:
    """Renders one scene again and again, and tells when its files change.

    Parameters
    ----------
    path : Path
        A scene or mesh file.
    given : sequence of str
        Overrides as `-D` gives them, before all edits.
    threads : int or None
        By default one for each core.
    saves_anywhere : bool
        False to save in the scene's folder or below alone.
    """

    def __init__(
        self,
        path: Path,
        given: Sequence[str] = (),
        threads: int | None = None,
        saves_anywhere: bool = True,
    ) -> None:
        self.path = path
        self.given = tuple(given)
        self._saves_anywhere = saves_anywhere
        self._threads = threads
        self._images = HeldImages()
        self._worker = Worker(self._images)
        self._lasting: dict[tuple[str, str], frozenset[str]] = {}
        """Keys of what pictures leave in memory, by their stage and layer."""
        self._watch = Watch()
        self._files = 0
        """Number of the files of the scene that are watched."""

    def loaded(self, overrides: Sequence[str] = ()) -> SceneFile:
        """The scene with overrides.

        Raises
        ------
        InputError
            All its problems.
        """
        return load(self.path, (*self.given, *overrides), self._worker.shared(self.path).text)

    def read(self) -> SceneFile:
        """Read the files of the scene, again; where they are faulty, the scene stays as it was.

        Raises
        ------
        InputError
            All problems of the scene without edits.
        """
        self._watch.begin()
        text = read_text(self.path)
        self._watch.add([self.path, *text.files])
        loaded = load(self.path, self.given, text)
        self._watch.add(text.tables.files)
        self._worker.reread(self.path, text)
        self._files = 0
        return loaded

    def command(self, window: Window) -> str:
        """The command that renders the picture of a window, and no other, for a shell."""
        scene, frame = window.now.scene, window.now.frame
        own = [layer.name for layer in layers(scene, scene.outputs.layers)]
        words = [] if own == [window.layer] else ["--only", window.layer]
        words += [] if scene.frames is None else ["--frames", f"{frame}:{frame}"]
        for option, variable in (("--models", "ILLUM_MODELS"), ("--allow", "ILLUM_ALLOW")):
            words += [word for folder in folders(variable) for word in (option, str(folder))]
        others = [f"cameras.{name}=null" for name in scene.cameras if name != window.camera]
        return command_text(self.path, (*self.given, *window.overrides, *others), words)

    def save(self, target: Path, window: Window, replace: bool = False) -> None:
        """Write the scene of a window with its edits; see `saving.save`."""
        if not self._saves_anywhere:
            refuse_elsewhere(target, self.path.parent)
        overrides = (*self.given, *overrides_of(window.edits))
        save(target, self.path, overrides, self._worker.shared(self.path).text, replace)

    @property
    def is_outdated(self) -> bool:
        """True if files have changed since they were read."""
        return self._watch.have_changed()

    def picture(self, window: Window, quality: Quality, progress: Progress) -> Picture:
        """The picture of a window.

        Raises
        ------
        IllumError
            What ``illum render`` would say.
        """
        start = time.perf_counter()
        work = self._work(window, quality)
        files = self._worker.shared(self.path).files
        if files.count != self._files:  # looking for what files name takes a while
            self._watch.add(files.paths())
            self._files = files.count

        # Pictures of several stages and layers take turns: what each reads again stays in memory, until the
        # camera moves. A full picture has no need of a reconstructed one.
        memory, kind = self._worker.shared(self.path).memory, stage(quality)
        memory.kept = frozenset().union(*self._lasting.values())
        self._images.images.clear()
        _, report = self._worker.run(work, progress)
        gone = {kind} if "hits" in report.rays else set()
        if quality is None:
            gone.add("reconstructed")
        self._lasting = {place: keys for place, keys in self._lasting.items() if place[0] not in gone}
        self._lasting[kind, window.layer] = memory.asked
        (image,) = self._images.images
        return Picture(window, quality, image, report, time.perf_counter() - start)

    def obscurance_rays(self, window: Window) -> int:
        """The obscurance rays that the full picture of a window would cast now, at most; to be asked after
        another picture of it, so that its meshes are in memory.

        Raises
        ------
        IllumError
            As of `picture`.
        """
        work = self._work(window, None)
        run = Run(cache=Cache(None, self._worker.shared(self.path).memory))
        graph = place_and_cull(work.graph, work.outputs, run)
        plan = plan_view(graph, work.outputs, graph.views[0], run.cache, look=True)
        rays = expected_rays(work.scene, [plan.view], plan.computed)
        return sum(rays.get(name, 0) for name in TRACED)

    def _work(self, window: Window, quality: Quality) -> Work:
        """The work of a picture of a window."""
        is_coarse = isinstance(quality, Coarse)
        options = RenderOptions(
            pattern="{camera}.exr",
            only=(window.layer,) if is_coarse else tuple(dict.fromkeys((window.layer, *PICKED))),
            threads=self._threads,
            force=True,
            cache=False,
            audit=not is_coarse,
            audit_precision=None if quality is None else AUDIT_PRECISION,
        )
        job = RenderJob(self.path, options, cameras=(window.camera,))
        loaded = replace(window.now, scene=scene_of(window.scene, window.camera, quality))
        work = work_of(job, loaded, self._worker.shared(self.path).files)
        return replace(work, images=self._images)
