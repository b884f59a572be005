"""Renders pictures of a scene with changing edits; what no edit touches is computed once."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.commands.held_images import HeldImage, HeldImages
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.report import Report
from illumcli.commands.unit import Worker
from illumcli.commands.work import Work, work_of
from illumcli.images.jpeg import jpeg_bytes
from illumcli.progress import Progress
from illumcli.records import Record
from illumcli.scene.load import load
from illumcli.scene.scene_file import SceneFile
from illumcli.viewer.quality import Coarse, coarse_scene
from illumcli.viewer.shown import Shown, view_values, with_values

PICKED = ("object_id", "material_id")
"""Layers of full pictures that say what is under the mouse."""
BEHIND = 36
"""Grey behind pictures with an alpha channel, of 255."""


class Picture(Record):
    """A picture of a window."""

    shown: Shown
    layer: str
    coarse: Coarse | None
    """How coarse it is; None for the full picture."""
    image: HeldImage
    report: Report
    seconds: float

    def layers(self) -> dict[str, NDArray[Any]]:
        """Layer -> (H, W, C), as ``illum render`` writes them."""
        return self.image.layers()

    @property
    def error(self) -> float | None:
        """Its root mean square error, where one was measured."""
        errors = self.report.audited_error.get(self.shown.camera)
        return None if errors is None else float(errors["rmse"])

    def pixels(self) -> NDArray[np.uint8]:
        """(H, W, 1 or 3), as a PNG shows the layer, in front of grey."""
        image = self.image
        (layer,) = (layer for layer in image.target.layers if layer.name == self.layer)
        target = replace(image.target, path=Path("picture.png"), layers=(layer,))
        pixels = image.work.development.encoded(target, self.layers(), (0, 0), image.space)
        if pixels.shape[-1] not in (2, 4):
            return pixels
        alpha = pixels[..., -1:]
        if (alpha == 255).all():
            return pixels[..., :-1]
        share = alpha.astype(np.float32) / 255
        return np.rint(pixels[..., :-1] * share + BEHIND * (1 - share)).astype(np.uint8)

    def jpeg(self) -> bytes:
        """The bytes that a browser shows."""
        return jpeg_bytes(self.pixels())


class Renderer:
    """Renders one scene again and again.

    Parameters
    ----------
    path : Path
        A scene or mesh file.
    given : sequence of str
        Overrides as `-D` gives them, before all edits.
    """

    def __init__(self, path: Path, given: Sequence[str] = (), threads: int | None = None) -> None:
        self.path = path
        self.given = tuple(given)
        self._threads = threads
        self._images = HeldImages()
        self._worker = Worker(self._images)
        self._last: dict[bool, Work] = {}

    def loaded(self, overrides: Sequence[str]) -> SceneFile:
        """The scene with overrides.

        Raises
        ------
        InputError
            All its problems.
        """
        return load(self.path, (*self.given, *overrides), self._worker.shared(self.path).text)

    def picture(self, shown: Shown, loaded: SceneFile, coarse: Coarse | None, progress: Progress) -> Picture:
        """The picture of what a window shows; `loaded` has its edits.

        Raises
        ------
        IllumError
            What ``illum render`` would say.
        """
        start = time.perf_counter()
        scene = with_values(loaded.scene, view_values(shown, loaded.scene))
        only = (shown.layer,) if coarse else tuple(dict.fromkeys((shown.layer, *PICKED)))
        options = RenderOptions(
            pattern="{camera}.exr",
            only=only,
            threads=self._threads,
            force=True,
            cache=False,
            audit=coarse is None,
        )
        if coarse is not None:
            scene = coarse_scene(scene, shown.camera, coarse)
        job = RenderJob(self.path, options, cameras=(shown.camera,))
        files = self._worker.shared(self.path).files
        work = replace(work_of(job, replace(loaded, scene=scene), files), images=self._images)

        # Coarse and full pictures take turns: what either will read again stays in memory.
        self._images.images.clear()
        _, report = self._worker.run(work, progress, self._last.get(coarse is None))
        self._last[coarse is not None] = work
        (image,) = self._images.images
        return Picture(shown, shown.layer, coarse, image, report, time.perf_counter() - start)
