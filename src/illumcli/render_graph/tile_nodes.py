"""Runs the nodes of a tile in their order, frees buffers after their last use, and measures each node."""

from __future__ import annotations

import threading
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.cache.pixels import PixelRecorder, common_pixels
from illumcli.cache.recorder import NO_CACHE, BufferRecorder, Cache
from illumcli.film.reconstruct import pixel_means, pixel_nearest
from illumcli.film.tiles import Tile
from illumcli.graph import Buffers
from illumcli.lights._incident import LitPoints
from illumcli.rays.embree import Interrupted
from illumcli.records import Record
from illumcli.render_graph.build import READ
from illumcli.render_graph.build_adaptive import FITTED
from illumcli.render_graph.schedule import Plan, uncached_plans
from illumcli.shading.direct import Lobes
from illumcli.visibility.object_pixels import FittedPixels
from illumcli.visibility.shadows import Shadows

Planes: TypeAlias = dict[str, NDArray[Any]]  # layer -> (rows, columns, channels), float32; ids are uint32
Kept: TypeAlias = dict[str, NDArray[Any] | None]  # buffer -> its values as the cache stores them
Develop: TypeAlias = Callable[[Tile, Planes], Mapping[str, NDArray[Any]]]
"""From a tile and its layers to arrays (rows, columns, channels) by name; called in any thread."""
LARGEST_FIT = 1 << 23
"""Pixels of a view whose fitted obscurance is kept, at most: it is held in memory until the last tile."""


@dataclass(slots=True)
class RenderStats:
    """Render statistics by node: seconds, rays, and work that was avoided. Threads add under a lock."""

    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    rays: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    saved: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    """Points that are unlit or in shadow, where no rays are cast or no models are evaluated; samples that
    adaptive sampling left out; polygons of culled objects."""
    refined: int = 0
    """Pixels that adaptive sampling gave all their samples."""
    mended: Counter[str] = field(default_factory=Counter)
    """Material -> values that its model gave as negative or not finite, and that are 0."""
    lock: threading.Lock = field(default_factory=threading.Lock)

    def add(
        self,
        seconds: Mapping[str, float],
        rays: Mapping[str, int],
        saved: Mapping[str, int] | None = None,
        refined: int = 0,
        mended: Mapping[str, int] = MappingProxyType({}),
    ) -> None:
        """Add the statistics of a node or tile."""
        with self.lock:
            self.refined += refined
            self.mended.update(mended)
            for name, value in seconds.items():
                self.seconds[name] += value
            for name, count in rays.items():
                self.rays[name] += count
            for name, count in (saved or {}).items():
                self.saved[name] += count


class TileContext(Record):
    """What all tiles of a view share."""

    plan: Plan
    shared: Buffers
    stats: RenderStats
    stop: threading.Event
    recorder: BufferRecorder
    develop: Develop
    pixel_recorder: PixelRecorder | None = None
    cache: Cache = NO_CACHE
    lock: threading.Lock = field(default_factory=threading.Lock)
    fits: list[FittedPixels] = field(default_factory=list)
    """Fitted obscurance of the tiles so far, if it is kept."""

    @cached_property
    def last_use(self) -> dict[int, Mapping[str, int]]:
        """`Plan.last_use` of plans by their identity."""
        return {}

    @cached_property
    def held(self) -> NDArray[np.int64]:
        """Numbers of the pixels whose buffers of all samples are cached, ascending."""
        others = self.plan.all_samples
        return common_pixels([*others.lookup.pixels.values()] if others else [])

    def uncached(self) -> tuple[Plan, Plan, Buffers]:
        """Plans that load no buffer of a tile, for one sample of some pixels and for all, and the scene
        buffers that they need, some of which may be computed only now.
        """
        with self.lock:
            return self._uncached

    @cached_property
    def _uncached(self) -> tuple[Plan, Plan, Buffers]:
        centres, all_samples = uncached_plans(self.plan, self.cache)
        shared = dict(self.shared)
        for node in (*centres.once, *all_samples.once):
            if node.output not in shared:
                start = time.perf_counter()
                value = shared[node.output] = node.run(shared)
                self.stats.add({node.output: time.perf_counter() - start}, {})
                if self.cache.memory is not None and node.output in all_samples.lookup.keeps:
                    self.cache.memory.once[all_samples.lookup.keeps[node.output]] = value
        return centres, all_samples, shared


class StartedTile(Record):
    """A tile of which some nodes have run."""

    plan: Plan
    tile: Tile
    buffers: dict[str, Any]
    kept: Kept
    own: Tile | None = None
    """The part of the tile whose buffers are cached."""
    pixel_recorder: PixelRecorder | None = None
    """What keeps its buffers, if it is some pixels of an adaptive picture."""


def developed_layers(common: TileContext, tile: Tile, buffers: Buffers) -> Mapping[str, NDArray[Any]]:
    """One tile's developed layers."""
    start = time.perf_counter()
    out = common.develop(tile, pixel_layers(common.plan, buffers, tile))
    common.stats.add({"film": time.perf_counter() - start}, {})
    return out


def tile_buffers(common: TileContext, plan: Plan, tile: Tile) -> tuple[dict[str, Any], Kept]:
    """The buffers of one tile that the film reads, and those for the cache."""
    started = StartedTile(plan, tile, given_buffers(common, plan, tile), {})
    run_nodes(common, started, range(len(plan.tile)))
    return started.buffers, started.kept


def given_buffers(
    common: TileContext, plan: Plan, tile: Tile, shared: Buffers | None = None
) -> dict[str, Any]:
    """The buffers that the nodes of a tile start from."""
    shared = common.shared if shared is None else shared
    buffers: dict[str, Any] = {**shared, "view": plan.view, "tile": tile, READ: None}
    if "tracer" in shared:
        buffers["tracer"] = shared["tracer"].counting(common.stop)
    return buffers


def run_nodes(common: TileContext, started: StartedTile, numbers: Iterable[int]) -> None:
    """Run the nodes of these numbers on the buffers of a tile."""
    buffers, tracer = started.buffers, started.buffers.get("tracer")
    seconds: dict[str, float] = {}
    rays, unlit = {}, {}
    mended: Counter[str] = Counter()
    plan = started.plan
    if id(plan) not in common.last_use:
        common.last_use[id(plan)] = plan.last_use()
    last_use = common.last_use[id(plan)]
    for number in numbers:
        node = plan.tile[number]
        if common.stop.is_set():
            raise Interrupted

        # Compute the buffer, and measure it.
        start, before = time.perf_counter(), tracer.rays if tracer else 0
        value = buffers[node.output] = node.run(buffers)
        elapsed = time.perf_counter() - start
        if isinstance(value, Shadows):  # those of each light are its own
            for name, share in value.shares(elapsed).items():
                of_light = f"shadow:{name.partition(':')[2]}"
                seconds[of_light], rays[of_light] = share, value.rays[name]
        else:
            seconds[node.output] = seconds.get(node.output, 0.0) + elapsed
            if tracer and tracer.rays > before:
                rays[node.output] = tracer.rays - before
        if isinstance(value, LitPoints):
            unlit[node.output] = value.count - len(value.index)
        elif isinstance(value, Lobes):
            mended.update(value.mended)

        # Hand it to the cache, and drop the buffers that no later node needs.
        if node.output == FITTED:
            key = plan.lookup.keeps.get(FITTED)
            small = plan.view.width * plan.view.height <= LARGEST_FIT
            if key is not None and small and common.cache.is_read_again(FITTED, key):
                common.fits.append(value)
        elif plan is common.plan and node.output in common.recorder.names:
            tile, own = started.tile, started.own
            started.kept[node.output] = common.recorder.take(node.output, buffers, tile, own)
        elif started.pixel_recorder is not None and node.output in started.pixel_recorder.names:
            started.pixel_recorder.take(node.output, buffers, started.tile)
        for name in node.inputs.values():
            if last_use.get(name) == number:
                buffers.pop(name, None)
    common.stats.add(seconds, rays, unlit, mended=mended)


def pixel_layers(plan: Plan, buffers: Buffers, tile: Tile) -> Planes:
    """The layers of a tile, reconstructed from the buffers of its samples."""
    view = plan.view
    sample = buffers["hits"].sample
    pixels = tile.width * tile.height
    out = {}
    for layer in plan.sampled:
        values = buffers[layer.buffer]
        if layer.per_pixel:
            by_pixel = values
        elif layer.data:
            by_pixel = pixel_nearest(values, sample, buffers["samples"].nearest(), pixels)
        else:
            by_pixel = pixel_means(values, sample, pixels, view.samples)
        out[layer.name] = by_pixel.reshape(tile.height, tile.width, -1)
    if "alpha" in buffers and "alpha" not in out:
        alpha = pixel_means(buffers["alpha"], sample, pixels, view.samples)
        out["alpha"] = alpha.reshape(tile.height, tile.width, 1)
    return out
