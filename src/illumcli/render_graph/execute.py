"""Runs a plan over tiles on a thread pool, frees buffers after their last use, and measures each node."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from illumcli.cache.pixels import PixelRecorder, are_among, common_pixels
from illumcli.cache.recorder import NO_CACHE, BufferRecorder, Cache
from illumcli.film.reconstruct import pixel_means, pixel_nearest
from illumcli.film.tiles import MAX_TILE_SAMPLES, Scattered, Tile, tiles
from illumcli.graph import Buffers, Node
from illumcli.layers import FIXED
from illumcli.lights._incident import LitPoints
from illumcli.memory import keep_freed_memory
from illumcli.rays.embree import Interrupted
from illumcli.records import Record, Value
from illumcli.render_graph.build import READ, SURROUNDINGS
from illumcli.render_graph.build_adaptive import decision
from illumcli.render_graph.replicates import REPLICATED, pixel_luminance, standard_error
from illumcli.render_graph.schedule import Plan, uncached_plans
from illumcli.visibility.object_pixels import ObjectPixels, within
from illumcli.visibility.reconstruction import MARGIN

Result = TypeVar("Result")
Planes: TypeAlias = dict[str, NDArray[Any]]  # layer -> (rows, columns, channels), float32; ids are uint32
Kept: TypeAlias = dict[str, NDArray[Any] | None]  # buffer -> its values as the cache stores them
Develop: TypeAlias = Callable[[Tile, Planes], Mapping[str, NDArray[Any]]]
"""From a tile and its layers to arrays (rows, columns, channels) by name; called in any thread."""


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
    lock: threading.Lock = field(default_factory=threading.Lock)

    def add(
        self,
        seconds: Mapping[str, float],
        rays: Mapping[str, int],
        saved: Mapping[str, int] | None = None,
        refined: int = 0,
    ) -> None:
        """Add the statistics of a node or tile."""
        with self.lock:
            self.refined += refined
            for name, value in seconds.items():
                self.seconds[name] += value
            for name, count in rays.items():
                self.rays[name] += count
            for name, count in (saved or {}).items():
                self.saved[name] += count


class Band(Record):
    """Finished rows of an image."""

    y: int
    layers: Mapping[str, NDArray[Any]]  # layers, or the arrays developed from them: (rows, width, channels)


class Run(Value):
    """How nodes are run: the statistics they add to, the cache and the number of threads."""

    stats: RenderStats = field(default_factory=RenderStats)
    cache: Cache = NO_CACHE
    threads: int = 1


class _Common(Record):
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


def _pixel_recorder(plan: Plan, cache: Cache) -> PixelRecorder | None:
    """What keeps the pixels of an adaptive picture that have all samples, where something is kept."""
    others = plan.all_samples
    if others is None or (cache.store is None and cache.memory is None):
        return None
    return PixelRecorder(cache.store, cache.memory, others.lookup.keeps, others.lookup.pixels, others.view)


def _unchanged(tile: Tile, layers: Planes) -> Planes:
    return layers


def run_once(plan: Plan, run: Run) -> dict[str, Any]:
    """The buffers of the whole scene, computed in parallel where they do not need each other.

    If several nodes fail, the error of the first one in the plan is raised.
    """
    pending: dict[str, Future[Any]] = {}

    def compute(node: Node) -> Any:
        inputs = {name: pending[name].result() for name in node.inputs.values()}  # submitted before this node
        start = time.perf_counter()
        value = node.run(inputs)
        run.stats.add({node.output: time.perf_counter() - start}, {})
        return value

    keeps = {**(plan.all_samples.lookup.keeps if plan.all_samples else {}), **plan.lookup.keeps}
    buffers: dict[str, Any] = {}
    pool = ThreadPoolExecutor(run.threads, thread_name_prefix="once")
    try:
        for node in plan.once:
            pending[node.output] = pool.submit(compute, node)
        for name, future in pending.items():
            buffers[name] = future.result()
            if name in keeps:
                run.cache.keep(name, keeps[name], buffers[name], _cost(plan, name, run.stats))
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
    return buffers


def _cost(plan: Plan, name: str, stats: RenderStats) -> float:
    """Processor seconds that a buffer took, with everything that was computed for it."""
    return sum(stats.seconds.get(need, 0.0) for need in plan.needed_for(name))


def bands(
    plan: Plan,
    shared: Buffers,
    run: Run,
    done: Callable[[int], None] = lambda pixels: None,
    side: int | None = None,
    develop: Develop = _unchanged,
) -> Iterator[Band]:
    """The image of a view as bands of rows from the top, each as soon as its tiles are finished.

    Bands hold the layers, or the arrays that `develop` computes from them tile by tile. The pixels do not
    depend on the number of threads, the `side` of tiles or the cache; buffers that are worth it are cached.
    If the consumer stops or is interrupted, tiles in progress end at their next node.

    Parameters
    ----------
    shared : mapping
        The buffers of the whole scene, from `run_once`.
    done : callable
        Called with the number of pixels of each finished tile.
    """
    view = plan.view
    rows = tiles(view.width, view.height, plan.tile_side(view, side), plan.samples_per_pixel)
    keeps = plan.lookup.keeps
    recorder, stop = BufferRecorder(run.cache, keeps, view), threading.Event()
    common = _Common(
        plan, shared, run.stats, stop, recorder, develop, _pixel_recorder(plan, run.cache), run.cache
    )
    compute = _adaptive_tile if plan.all_samples else _tile
    keep_freed_memory()
    with ThreadPoolExecutor(run.threads, thread_name_prefix="tile") as pool:
        try:
            pending: list[tuple[Tile, Future[tuple[Mapping[str, NDArray[Any]], Kept]]]] = []
            queue = iter([tile for row in rows for tile in row])
            ahead = _Ahead(common, rows, pool)

            # Keep a row of tiles and a few more in progress, so that no thread waits for the consumer.
            def submit() -> None:
                for tile in queue:
                    future = ahead.submit(tile) if plan.before else pool.submit(compute, common, tile)
                    pending.append((tile, future))
                    if len(pending) >= run.threads + 1 + (0 if plan.before else len(rows[0])):
                        break

            submit()
            for row in rows:
                # Join the tiles of a row in their order.
                height = row[0].height
                band: dict[str, NDArray[Any]] = {}
                kept: dict[str, list[NDArray[Any] | None]] = defaultdict(list)
                for _ in row:
                    tile, future = pending.pop(0)
                    layers, others = _result(future)
                    for name, values in layers.items():
                        if name not in band:
                            band[name] = np.empty((height, view.width, values.shape[2]), values.dtype)
                        band[name][:, tile.x : tile.x + tile.width] = values
                    for name, packed in others.items():
                        kept[name].append(packed)
                    done(tile.width * tile.height)
                    submit()
                recorder.write(kept)
                yield Band(row[0].y, band)
            recorder.finish({name: _cost(plan, name, run.stats) for name in keeps})
            if plan.all_samples is not None and common.pixel_recorder is not None:
                names = plan.all_samples.lookup.keeps
                common.pixel_recorder.finish({name: _cost(plan, name, run.stats) for name in names})
        finally:
            stop.set()
            recorder.discard()
            pool.shutdown(wait=True, cancel_futures=True)


def _result(future: Future[Result]) -> Result:
    """What a thread computed; waits in short steps, so that an interrupt reaches this thread."""
    while not wait([future], timeout=0.2, return_when=FIRST_COMPLETED).done:
        pass
    return future.result()


class _Started(Record):
    """A tile of which some nodes have run."""

    plan: Plan
    tile: Tile
    buffers: dict[str, Any]
    kept: Kept
    own: Tile | None = None
    """The part of the tile whose buffers are cached."""


class _Ahead:
    """Runs the first nodes of tiles some rows ahead of the others, which read the pixels around."""

    def __init__(self, common: _Common, rows: Sequence[Sequence[Tile]], pool: ThreadPoolExecutor) -> None:
        self.common, self.rows, self.pool = common, rows, pool
        self.first_row, self.next_row = 0, 0
        self.started: dict[Tile, Future[_Started]] = {}
        self.pixels: dict[Tile, ObjectPixels] = {}

    def submit(self, tile: Tile) -> Future[tuple[Mapping[str, NDArray[Any]], Kept]]:
        """Run the other nodes of a tile, once the first ones of the tiles around have run."""
        # Start the first nodes of all rows that this tile reads, and of one more, so that no thread waits.
        lower = tile.y + tile.height + MARGIN
        while self.next_row < len(self.rows) and (
            self.next_row == 0 or self.rows[self.next_row - 1][0].y < lower
        ):
            for each in self.rows[self.next_row]:
                self.started[each] = self.pool.submit(_first_nodes, self.common, each)
            self.next_row += 1

        # Drop the pixels that no later tile reads.
        upper = tile.y - MARGIN
        while self.rows[self.first_row][0].y + self.rows[self.first_row][0].height <= upper:
            for each in self.rows[self.first_row]:
                del self.pixels[each]
            self.first_row += 1

        # The pixels around, of the row itself and all that reach into its margin.
        parts = []
        for row in self.rows[self.first_row : self.next_row]:
            for each in row if row[0].y < lower else ():
                if each not in self.pixels:
                    self.pixels[each] = _result(self.started[each]).buffers["object_pixels"].pixels
                if each.x < tile.x + tile.width + MARGIN and each.x + each.width > tile.x - MARGIN:
                    parts.append(self.pixels[each])
        own = _result(self.started.pop(tile))
        return self.pool.submit(_last_nodes, self.common, own, parts)


def _first_nodes(common: _Common, tile: Tile) -> _Started:
    """A tile after the nodes whose results the tiles around read."""
    started = _Started(common.plan, tile, _given(common, common.plan, tile), {})
    _run_nodes(common, started, range(common.plan.before))
    return started


def _last_nodes(
    common: _Common, started: _Started, parts: Sequence[ObjectPixels]
) -> tuple[Mapping[str, NDArray[Any]], Kept]:
    """One tile's developed layers, and its buffers for the cache; `parts` are the pixels around."""
    plan = common.plan
    started.buffers[SURROUNDINGS] = within(parts, started.tile, MARGIN)
    _run_nodes(common, started, range(plan.before, len(plan.tile)))
    return _developed(common, started.tile, started.buffers), started.kept


def at_pixels(plan: Plan, shared: Buffers, run: Run, x: NDArray[np.int64], y: NDArray[np.int64]) -> Planes:
    """Layer -> (K, channels) at K pixels of a view, equal to what `bands` computes there.

    Raises
    ------
    ValueError
        The plan reads the pixels around those asked for.
    """
    if plan.before:
        raise ValueError("pixels that read those around them are not rendered alone")
    count = max(1, min(MAX_TILE_SAMPLES // plan.view.samples, -(-len(x) // run.threads)))
    pieces = [Scattered.at(x[a : a + count], y[a : a + count], a) for a in range(0, len(x), count)]
    stop, recorder = threading.Event(), BufferRecorder(NO_CACHE, {}, plan.view)
    common = _Common(plan, shared, run.stats, stop, recorder, _unchanged)
    with ThreadPoolExecutor(run.threads, thread_name_prefix="tile") as pool:
        try:
            pending = [pool.submit(_tile, common, tile) for tile in pieces]
            parts = [future.result()[0] for future in pending]
        finally:
            stop.set()
            pool.shutdown(wait=True, cancel_futures=True)
    return {name: np.concatenate([part[name][0] for part in parts]) for name in parts[0]}


def _tile(common: _Common, tile: Tile) -> tuple[Mapping[str, NDArray[Any]], Kept]:
    """One tile's developed layers, and its buffers for the cache."""
    buffers, kept = _buffers(common, common.plan, tile)
    return _developed(common, tile, buffers), kept


def _developed(common: _Common, tile: Tile, buffers: Buffers) -> Mapping[str, NDArray[Any]]:
    """One tile's developed layers."""
    start = time.perf_counter()
    out = common.develop(tile, _pixels(common.plan, buffers, tile))
    common.stats.add({"film": time.perf_counter() - start}, {})
    return out


def _buffers(common: _Common, plan: Plan, tile: Tile) -> tuple[dict[str, Any], Kept]:
    """The buffers of one tile that the film reads, and those for the cache."""
    started = _Started(plan, tile, _given(common, plan, tile), {})
    _run_nodes(common, started, range(len(plan.tile)))
    return started.buffers, started.kept


def _given(common: _Common, plan: Plan, tile: Tile, shared: Buffers | None = None) -> dict[str, Any]:
    """The buffers that the nodes of a tile start from."""
    shared = common.shared if shared is None else shared
    buffers: dict[str, Any] = {**shared, "view": plan.view, "tile": tile, READ: None}
    if "tracer" in shared:
        buffers["tracer"] = shared["tracer"].counting(common.stop)
    return buffers


def _run_nodes(
    common: _Common, started: _Started, numbers: range, pixel_recorder: PixelRecorder | None = None
) -> None:
    """Run the nodes of these numbers on the buffers of a tile."""
    buffers, tracer = started.buffers, started.buffers.get("tracer")
    seconds, rays, unlit = {}, {}, {}
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
        seconds[node.output] = time.perf_counter() - start
        if tracer and tracer.rays > before:
            rays[node.output] = tracer.rays - before
        if isinstance(value, LitPoints):
            unlit[node.output] = value.count - len(value.index)

        # Hand it to the cache, and drop the buffers that no later node needs.
        if plan is common.plan and node.output in common.recorder.names:
            tile, own = started.tile, started.own
            started.kept[node.output] = common.recorder.take(node.output, buffers, tile, own)
        elif pixel_recorder is not None and node.output in pixel_recorder.names:
            pixel_recorder.take(node.output, buffers, started.tile)
        for name in node.inputs.values():
            if last_use.get(name) == number:
                buffers.pop(name, None)
    common.stats.add(seconds, rays, unlit)


def _adaptive_tile(common: _Common, tile: Tile) -> tuple[Mapping[str, NDArray[Any]], Kept]:
    """One tile's developed layers: of its pixels' centres, and of all samples where these are not enough.

    Each layer decides for itself, independently of the other layers.
    """
    plan, all_samples, stats = common.plan, common.plan.all_samples, common.stats
    assert all_samples is not None

    # What decides about the pixels, with a border, so that a pixel has the same neighbours in any tile.
    view = plan.view
    bordered = tile.grown(view.border, view.width, view.height)
    own, shape = tile.within(bordered), (bordered.height, bordered.width)
    started = _Started(plan, bordered, _given(common, plan, bordered), {}, tile)
    _run_nodes(common, started, range(plan.decided_by))
    buffers = started.buffers
    means = [*all_samples.outputs, FIXED["alpha"]]
    refined = {
        layer.name: buffers[decision(layer)].reshape(shape)[own]
        for layer in means
        if decision(layer) in buffers
    }

    # The layers at the centres; obscurance only where some layer shows it.
    read = np.zeros(shape, np.bool_)
    read[own] = ~np.logical_and.reduce([refined[layer.name] for layer in all_samples.outputs])
    buffers[READ] = read.ravel()
    _run_nodes(common, started, range(plan.decided_by, len(plan.tile)))
    start = time.perf_counter()
    layers = {name: np.array(values[own]) for name, values in _pixels(plan, buffers, bordered).items()}
    stats.add({"film": time.perf_counter() - start}, {})

    # Pixels that an earlier picture did not read the obscurance of.
    everywhere = np.ones((tile.height, tile.width), np.bool_)
    lacks = _lacking(buffers, read)[own]
    _at(common, tile, lacks, layers, dict.fromkeys(layers, everywhere), "centres")

    # All samples of the pixels that some layer needs them for, cached or not.
    wanted = np.logical_or.reduce([*refined.values()])
    y, x = np.nonzero(wanted)
    cached = np.zeros_like(wanted)
    cached[y, x] = are_among((y + tile.y) * view.width + x + tile.x, common.held)
    _at(common, tile, cached, layers, refined, "cached")
    _at(common, tile, wanted & ~cached, layers, refined, "computed")

    count = int(np.count_nonzero(wanted))
    stats.add({}, {}, {"samples": (wanted.size - count) * (all_samples.view.samples - 1)}, count)
    if plan.replicates is not None:
        layers["error"] = _error(common, plan.replicates, tile, layers)
        if FIXED["beauty"] not in plan.outputs:  # it was computed for its error alone
            layers = {layer.name: layers[layer.name] for layer in plan.outputs}
    start = time.perf_counter()
    developed = common.develop(tile, layers)
    stats.add({"film": time.perf_counter() - start}, {})
    return developed, started.kept


def _error(common: _Common, plan: Plan, tile: Tile, layers: Planes) -> NDArray[np.float32]:
    """The layer `error` of a tile, from replicates with all samples, which see what one sample misses."""
    buffers, _ = _buffers(common, plan, tile)
    samples, second = (buffers[name] for name in REPLICATED)
    background = plan.graph.scene.film.background or (0.0, 0.0, 0.0)
    first = pixel_luminance(background, layers["beauty"], layers["alpha"])
    error = standard_error(plan.view, tile, samples, first, second)
    return error.reshape(tile.height, tile.width, 1)


def _lacking(buffers: Buffers, read: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which of the pixels that are read have no obscurance: NaN was cached."""
    out = np.zeros(read.size, np.bool_)
    if "obscurance" in buffers:
        out[buffers["hits"].sample] = np.isnan(buffers["obscurance"])
    return out.reshape(read.shape) & read


def _at(
    common: _Common,
    tile: Tile,
    which: NDArray[np.bool_],
    layers: Planes,
    masks: Mapping[str, NDArray[np.bool_]],
    kind: Literal["centres", "cached", "computed"],
) -> None:
    """Set layers at some pixels of a tile, each where its mask is True.

    `centres`: computed anew at one sample. All samples: of `cached` buffers, or `computed`.
    """
    down, across = np.nonzero(which)
    if not len(down):
        return
    plan, shared = common.plan.all_samples, common.shared
    if kind != "cached":
        centres, all_samples, shared = common.uncached()
        plan = centres if kind == "centres" else all_samples
    assert plan is not None
    recorder = common.pixel_recorder if kind == "computed" else None
    at_once = max(1, MAX_TILE_SAMPLES // plan.view.samples)
    for first in range(0, len(down), at_once):
        y, x = down[first : first + at_once], across[first : first + at_once]
        pixels = Scattered.at(x + tile.x, y + tile.y)
        started = _Started(plan, pixels, _given(common, plan, pixels, shared), {})
        _run_nodes(common, started, range(len(plan.tile)), recorder)
        start = time.perf_counter()
        for name, values in _pixels(plan, started.buffers, pixels).items():
            mine = masks[name][y, x]
            layers[name][y[mine], x[mine]] = values[0][mine]
        common.stats.add({"film": time.perf_counter() - start}, {})


def _pixels(plan: Plan, buffers: Buffers, tile: Tile) -> Planes:
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
