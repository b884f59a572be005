"""Choose sample counts for a reconstructed image of a given error, by rendering it until its audit says so.

Each attempt renders the whole image, since a fit reads the pixels around. Its error has two parts that audits
tell apart: that of the fit, from estimates at the image's own camera samples, and that of antialiasing, which
is the rest. Both follow a law of the counts, by which the next attempt is chosen. The pixels that choose do
not state the error: the last image is audited again with other random numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from illumcli.accuracy.audit import CAMERA_SAMPLES, PRECISION, Audit, AuditedError, audited_layer
from illumcli.accuracy.target import ATTEMPTS, MARGIN, SAMPLE_COST, count_overrides
from illumcli.cache.memory import MemoryCache
from illumcli.cache.recorder import Cache
from illumcli.cache.store import Store
from illumcli.film.tiles import Tile
from illumcli.film.view import View
from illumcli.rays.sampling import stream
from illumcli.records import Record
from illumcli.render_graph.build import Graph, build
from illumcli.render_graph.build_adaptive import FITTED
from illumcli.render_graph.execute import Run, bands, run_once
from illumcli.render_graph.limits import refuse_rays
from illumcli.render_graph.needs import PROBE_SHARE
from illumcli.render_graph.pipeline import place_and_cull, plan_view
from illumcli.render_graph.schedule import error_is_audited, needed_buffers, outputs_of
from illumcli.render_graph.tile_nodes import Planes
from illumcli.scene.load import load
from illumcli.scene.spec import Scene

FIRST_FIT, FIRST_EDGES = 0.0095, 0.0115
"""RMSE of the fit at one ray per pixel, and of antialiasing at one sample, that the first attempt is chosen
by: those of a mesh that fills half the picture."""
FIRST_REFINED = 0.05
"""Share of the pixels that the first attempt expects to have edges."""
FIT_POWER = 0.9
"""Mean square error of the fit falls by this power of the rays per pixel: much less than that of the rays
alone, as a bias remains where w bends."""
EDGE_POWER = 1.5
"""Mean square error of antialiasing falls by this power of the samples per pixel."""
MOST_PIXEL_SAMPLES, MOST_RAYS = 256, 256
"""Samples per pixel, and obscurance rays, that are tried; beyond them fits gain little on rays alone."""
PRECISIONS = {"choice": 0.06, "fit": 0.15, "statement": PRECISION}
"""Relative standard errors of what audits are for."""
LARGEST = 1 << 24
"""Pixels of a picture that is tried, at most: its buffers are held in memory."""


class ReconstructedChoice(Record):
    """Sample counts of a reconstructed image for a target error, and the error it was found to have."""

    target: float
    scene: Scene
    pixel: int
    """Samples per pixel."""
    obscurance: int
    """Obscurance rays per sample."""
    audited: Mapping[str, AuditedError]
    """By camera."""
    pilot_rays: int
    memory: MemoryCache
    """Buffers of the last attempt."""

    @property
    def overrides(self) -> tuple[str, ...]:
        """The counts as `-D` overrides."""
        counts = count_overrides(self.scene, self.pixel, self.obscurance)
        return (*counts, "obscurance.reconstruct=true")

    def as_data(self) -> dict[str, float]:
        """The choice as reports hold it."""
        return {
            "target": self.target,
            "reached": max(error.rmse for error in self.audited.values()),
            "pixel_samples": self.pixel,
            "obscurance_samples": self.obscurance,
            "reconstructed": True,
            "pilot_rays": self.pilot_rays,
        }


class Parts(Record):
    """Mean square error of an attempt, the largest of all cameras, and of its fit alone."""

    pixel: int
    obscurance: int
    total: float
    fit: float
    refined: float
    """Share of the pixels that take all samples."""

    def cost(self, pixel: int, obscurance: int) -> float:
        """Cost of a pixel at counts, in obscurance rays: of one sample and its probes, and of all samples
        where it is refined; all if every pixel is."""
        samples = pixel if self.refined == 1 else 1 + pixel * (self.refined + 0.5 / PROBE_SHARE)
        return SAMPLE_COST * samples + pixel * obscurance

    def expected(self, pixel: int, obscurance: int) -> float:
        """Mean square error at other counts."""
        rays = (pixel * obscurance) / (self.pixel * self.obscurance)
        edges = max(self.total - self.fit, 0.02 * self.total)
        return self.fit * rays**-FIT_POWER + edges * (_spread(pixel) / _spread(self.pixel)) ** -EDGE_POWER

    def next_counts(self, target: float) -> tuple[int, int] | None:
        """Samples per pixel and rays per sample of least cost that should reach the target; None: no counts
        that are tried."""
        enough = [
            (self.cost(pixel, each), pixel, each)
            for pixel in (1 << k for k in range(MOST_PIXEL_SAMPLES.bit_length()))
            for each in (1 << k for k in range(MOST_RAYS.bit_length()))
            if pixel * each <= max(MOST_RAYS, pixel)
            and (pixel > self.pixel or pixel * each > self.pixel * self.obscurance)
            and self.expected(pixel, each) <= (MARGIN * target) ** 2
        ]
        return min(enough)[1:] if enough else None


def _spread(pixel: int) -> float:
    """Samples per pixel as antialiasing counts them: a single one, at the centre, errs half as much as one
    that is drawn."""
    return pixel if pixel > 1 else 2 ** (1 / EDGE_POWER)


class Attempts(Record):
    """Renders the layers of a scene at counts, and audits them."""

    path: Path
    overrides: tuple[str, ...]
    only: tuple[str, ...]
    seed: int | None
    threads: int
    store: Store | None
    memory: MemoryCache = field(default_factory=MemoryCache)
    spent: dict[str, int] = field(default_factory=dict)

    def graph(self, overrides: Sequence[str] = ()) -> Graph:
        """The graph of the scene with overrides."""
        loaded = load(self.path, (*self.overrides, *overrides))
        scene = loaded.scene
        if self.seed is not None:
            scene = scene.model_copy(update={"seed": self.seed})
        return build(scene, loaded)

    def rendered(self, overrides: Sequence[str]) -> list[Attempt]:
        """Every view of an attempt."""
        graph = self.graph(overrides)
        outputs = outputs_of(graph.scene, self.only)
        refuse_rays(graph, outputs)
        run = Run(cache=Cache(self.store, self.memory), threads=self.threads)
        graph = place_and_cull(graph, outputs, run)
        views = [self._view(graph, view, run) for view in graph.views]
        self.memory.retire()
        for name, count in run.stats.rays.items():
            self.spent[name] = self.spent.get(name, 0) + count
        return views

    def _view(self, graph: Graph, view: View, run: Run) -> Attempt:
        """One view of an attempt; its tiles are kept in memory alone."""
        outputs = outputs_of(graph.scene, self.only)
        plan = plan_view(graph, outputs, view, run.cache)
        kept = {"hits", FITTED, *needed_buffers(graph, outputs, [view])}
        self.memory.wanted |= {plan.lookup.keeps[name] for name in kept if name in plan.lookup.keeps}
        layer = audited_layer(plan)
        assert layer is not None
        several = max(view.samples, CAMERA_SAMPLES)  # of one sample per pixel, too: its edges err
        audits = {
            purpose: replace(
                Audit.of(plan, layer, stream(graph.scene.seed, purpose)),
                camera_samples=None if purpose == "fit" else several,
                precision=precision,
            )
            for purpose, precision in PRECISIONS.items()
        }

        def develop(tile: Tile, layers: Planes) -> Planes:
            for audit in audits.values():
                audit.take(tile, layers)
            return {}

        shared, before = run_once(plan, run), run.stats.refined
        for _ in bands(plan, shared, replace(run, cache=Cache(None, self.memory)), develop=develop):
            pass
        refined = run.stats.refined - before if plan.all_samples else view.width * view.height
        return Attempt(view.name, shared, audits, refined / (view.width * view.height), self)


class Attempt(Record):
    """One view of an attempt."""

    camera: str
    shared: Mapping[str, Any]
    audits: Mapping[str, Audit]
    refined: float
    """Share of the pixels that took all samples."""
    attempts: Attempts

    def error(self, purpose: str) -> AuditedError:
        """The error by the audit for a choice or a statement, or that of the fit alone."""
        error = self.audits[purpose].error(self.shared, Run(threads=self.attempts.threads))
        self.attempts.spent["audit"] = self.attempts.spent.get("audit", 0) + error.rays
        return error


def can_reconstruct(graph: Graph, only: Sequence[str]) -> bool:
    """Does a layer whose error is asked for depend on obscurance that a fit may estimate?"""
    outputs = outputs_of(graph.scene, only)
    if error_is_audited(graph.scene, outputs):  # its own audit comes after the picture is chosen
        return False
    means = [layer for layer in outputs if not layer.data]
    too_large = any(view.width * view.height > LARGEST for view in graph.views)
    if not means or too_large or "raw_obscurance" not in graph.nodes:
        return False
    first = min(means, key=lambda layer: layer.buffer != "beauty")
    return "obscurance" in {node.output for node in graph.topological_order([first.buffer])}


def choose_reconstruction(attempts: Attempts, target: float) -> ReconstructedChoice | None:
    """Counts by which a reconstructed image reaches the RMSE `target`; None where none that are tried do, or
    nothing is to be reconstructed."""
    scene = attempts.graph().scene
    if not can_reconstruct(attempts.graph(_fixed(scene)), attempts.only):
        return None
    refined = FIRST_REFINED if scene.film.adaptive is not False else 1.0
    first = Parts(1, 1, FIRST_FIT**2 + FIRST_EDGES**2, FIRST_FIT**2, refined)
    counts = (1, 1) if first.total <= (MARGIN * target) ** 2 else first.next_counts(target)
    for _ in range(ATTEMPTS):
        if counts is None:
            return None
        pixel, each = counts
        overrides = (*count_overrides(scene, pixel, each), "obscurance.reconstruct=true")
        views = attempts.rendered(overrides)
        total = max(view.error("choice").rmse for view in views)
        if total <= MARGIN * target:
            audited = {view.camera: view.error("statement") for view in views}
            rays = sum(attempts.spent.values())
            return ReconstructedChoice(target, scene, pixel, each, audited, rays, attempts.memory)
        fit = max(view.error("fit").rmse for view in views)
        refined = max(view.refined for view in views)
        counts = Parts(pixel, each, total**2, fit**2, refined).next_counts(target)
    return None


def _fixed(scene: Scene) -> tuple[str, ...]:
    """What every attempt overrides."""
    if scene.obscurance is None or scene.obscurance.reconstruct is False:
        return ()
    return (*count_overrides(scene, 1, 1), "obscurance.reconstruct=true")
