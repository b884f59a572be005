"""Renders one layer of a scene at any sampling, the whole image or some pixels, to measure its error."""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Sequence
from dataclasses import field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.film.view import View
from illumcli.graph import Node
from illumcli.layers import Layer
from illumcli.rays.sampling import stream
from illumcli.records import Record, Value
from illumcli.render_graph.build import build
from illumcli.render_graph.execute import Run, at_pixels, bands
from illumcli.render_graph.framing import placed
from illumcli.render_graph.limits import refuse_rays
from illumcli.render_graph.needs import adaptive, views
from illumcli.render_graph.schedule import Plan, outputs_of, schedule
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.spec import Scene

RECONSTRUCTED = " reconstructed"
"""Behind the sampler's name."""


class Sampling(Value):
    """The sampling of an image: counts, sampler and seed."""

    pixel: int  # samples per pixel; a single one is at the pixel's centre
    obscurance: int  # rays per sample
    sampler: str
    seed: int
    reconstruct: bool = False
    """Is obscurance fitted to the surface? Then pixels without edges have one sample, unless the scene gives
    all to all."""

    @property
    def name(self) -> str:
        """What curves are called: the sampler, and whether its values are reconstructed."""
        return f"{self.sampler}{RECONSTRUCTED}" if self.reconstruct else self.sampler

    @property
    def rays(self) -> int:
        """Obscurance rays per pixel."""
        return self.pixel * self.obscurance


OF_SAMPLING = ("obscurance_method",)
"""Buffers of the whole scene that depend on the sampling."""


class SampledLayer(Record):
    """One layer of a view, with the buffers that do not depend on its sampling."""

    loaded: SceneFile
    view: View
    layer: Layer
    threads: int
    shared: dict[str, Any] = field(default_factory=dict)

    @property
    def scene(self) -> Scene:
        return self.loaded.scene

    def seen_by(self, view: View) -> SampledLayer:
        """The same layer from another view."""
        if view.camera.fit is not None:
            name = f"camera:{view.name}"
            self._compute(build(self.scene, self.loaded).topological_order([name]))
            view = placed(view, self.shared[name])
        return replace(self, view=replace(view, adaptive=None))

    def _compute(self, nodes: Iterable[Node]) -> None:
        """Compute the buffers that are missing or depend on the sampling."""
        for node in nodes:
            if node.output not in self.shared or node.output in OF_SAMPLING:
                self.shared[node.output] = node.run(self.shared)

    def planned(self, sampling: Sampling) -> Plan:
        """The plan at a sampling; computes the buffers of the whole scene."""
        update: dict[str, Any] = {"seed": sampling.seed}
        if self.scene.obscurance is not None:
            finer = {
                "samples": sampling.obscurance,
                "sampler": sampling.sampler,
                "reconstruct": sampling.reconstruct,
            }
            update["obscurance"] = self.scene.obscurance.model_copy(update=finer)
        view = replace(self.view, samples=sampling.pixel)
        if sampling.reconstruct:  # only such pictures are adaptive here: the scene must be, too
            named = self.scene.named_cameras().items()
            own = {name: camera.model_copy(update={"samples": sampling.pixel}) for name, camera in named}
            update |= {"camera": None, "cameras": own}
            view = replace(view, adaptive=adaptive(self.scene.model_copy(update=update), sampling.pixel))
        graph = build(self.scene.model_copy(update=update), self.loaded)
        outputs = outputs_of(graph.scene, [self.layer.name])
        refuse_rays(graph, outputs)
        plan = schedule(graph, outputs, view)
        self._compute(plan.once)
        return plan

    def render(self, sampling: Sampling) -> tuple[NDArray[np.float32], int, float]:
        """(H, W, channels) the layer at a sampling, the rays it took, and the seconds."""
        plan, run = self.planned(sampling), Run(threads=self.threads)
        start = time.perf_counter()
        rows = [band.layers for band in bands(plan, self.shared, run)]
        seconds = time.perf_counter() - start
        return np.concatenate([row[self.layer.name] for row in rows]), sum(run.stats.rays.values()), seconds

    def render_pixels(
        self, sampling: Sampling, x: NDArray[np.int64], y: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], int]:
        """(K, channels) the layer at K pixels, and the rays it took."""
        run = Run(threads=self.threads)
        layers = at_pixels(self.planned(sampling), self.shared, run, x, y)
        return layers[self.layer.name].astype(np.float64), sum(run.stats.rays.values())

    def random_pixels(self, count: int, purpose: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Columns and rows of `count` pixels drawn at random, or of all pixels if there are fewer."""
        pixels = self.view.width * self.view.height
        random = np.random.default_rng(stream(self.scene.seed, purpose))
        y, x = np.divmod(np.sort(random.choice(pixels, min(count, pixels), replace=False)), self.view.width)
        return x, y


def sampled_layer(
    loaded: SceneFile,
    name: str,
    threads: int | None = None,
    camera: str | None = None,
    width: int | None = None,
) -> SampledLayer:
    """A scene's layer, ready to be rendered at any sampling.

    Parameters
    ----------
    name : str
        A layer that is the mean of a pixel's samples; data layers such as depth have no error.
    camera : str, optional
        By default the first.
    width : int, optional
        The film is scaled down to at most this many pixels across.

    Raises
    ------
    InputError
        No such layer, or one without error; no such camera.
    """
    outputs = outputs_of(loaded.scene, [name])
    view = chosen_view(views(loaded.scene), camera)
    if len(outputs) != 1 or outputs[0].data:
        raise InputError(
            f"layer '{name}' is not a mean of samples; take beauty, ambient, obscurance or one light"
        )
    if width is not None and view.width > width:
        view = replace(view, width=width, height=max(1, round(view.height * width / view.width)))
    layer = SampledLayer(loaded, view, outputs[0], threads or len(os.sched_getaffinity(0)))
    return layer.seen_by(view)


def chosen_view(views: Sequence[View], camera: str | None) -> View:
    """The view of this name, or the first.

    Raises
    ------
    InputError
    """
    if camera is None:
        return views[0]
    named = {view.name: view for view in views}
    if camera not in named:
        raise InputError(f"no camera '{camera}'; there are: {', '.join(named)}")
    return named[camera]
