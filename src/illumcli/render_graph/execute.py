"""Runs a plan over tiles on a thread pool, frees buffers after their last use, and measures each node."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import column_major
from illumcli.cache.recorder import NO_CACHE, BufferRecorder, Cache
from illumcli.film.adaptive import differs_in_light, differs_in_shape
from illumcli.film.reconstruct import pixel_means, pixel_nearest
from illumcli.film.tiles import MAX_TILE_SAMPLES, Scattered, Tile, tiles
from illumcli.film.view import View
from illumcli.graph import Buffers, Node
from illumcli.lights._incident import LitPoints
from illumcli.memory import keep_freed_memory
from illumcli.rays.embree import Interrupted
from illumcli.records import Record, Value
from illumcli.render_graph.build import SHAPE, SURROUNDINGS
from illumcli.render_graph.schedule import Plan
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
        self, seconds: Mapping[str, float], rays: Mapping[str, int], saved: Mapping[str, int] | None = None
    ) -> None:
        """Add the statistics of a node or tile."""
        with self.lock:
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
    last_use: Mapping[str, int]


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

    buffers: dict[str, Any] = {}
    pool = ThreadPoolExecutor(run.threads, thread_name_prefix="once")
    try:
        for node in plan.once:
            pending[node.output] = pool.submit(compute, node)
        for name, future in pending.items():
            buffers[name] = future.result()
            if name in plan.lookup.keeps:
                run.cache.keep(name, plan.lookup.keeps[name], buffers[name], _cost(plan, name, run.stats))
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
    # An adaptive view first takes few samples of every pixel, so its tiles are larger.
    view = plan.view
    first = view.coarse() if view.is_adaptive else view
    rows = tiles(view.width, view.height, plan.tile_side(first, side), first.samples)
    keeps = {} if view.is_adaptive else plan.lookup.keeps
    recorder, stop = BufferRecorder(run.cache, keeps, view), threading.Event()
    common = _Common(plan, shared, run.stats, stop, recorder, develop, plan.last_use())
    compute = _adaptive_tile if view.is_adaptive else _tile
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

    tile: Tile
    buffers: dict[str, Any]
    kept: Kept


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
    started = _Started(tile, _given(common, common.plan.view, tile), {})
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
    count = max(1, MAX_TILE_SAMPLES // plan.view.samples)
    pieces = [Scattered.at(x[a : a + count], y[a : a + count]) for a in range(0, len(x), count)]
    stop, recorder = threading.Event(), BufferRecorder(NO_CACHE, {}, plan.view)
    common = _Common(plan, shared, run.stats, stop, recorder, _unchanged, plan.last_use())
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
    buffers, kept = _buffers(common, common.plan.view, tile)
    return _developed(common, tile, buffers), kept


def _developed(common: _Common, tile: Tile, buffers: Buffers) -> Mapping[str, NDArray[Any]]:
    """One tile's developed layers."""
    start = time.perf_counter()
    out = common.develop(tile, _pixels(common.plan, buffers, common.plan.view, tile))
    common.stats.add({"film": time.perf_counter() - start}, {})
    return out


def _buffers(common: _Common, view: View, tile: Tile) -> tuple[dict[str, Any], Kept]:
    """The buffers of one tile that the film reads, and those for the cache; `view` says how many samples."""
    started = _Started(tile, _given(common, view, tile), {})
    _run_nodes(common, started, range(len(common.plan.tile)))
    return started.buffers, started.kept


def _given(common: _Common, view: View, tile: Tile) -> dict[str, Any]:
    """The buffers that the nodes of a tile start from."""
    buffers: dict[str, Any] = {**common.shared, "view": view, "tile": tile}
    if "tracer" in common.shared:
        buffers["tracer"] = common.shared["tracer"].counting(common.stop)
    return buffers


def _run_nodes(common: _Common, started: _Started, numbers: range) -> None:
    """Run the nodes of these numbers on the buffers of a tile."""
    buffers, tracer = started.buffers, started.buffers.get("tracer")
    seconds, rays, unlit = {}, {}, {}
    for number in numbers:
        node = common.plan.tile[number]
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
        if node.output in common.recorder.names:
            started.kept[node.output] = common.recorder.take(node.output, buffers, started.tile)
        for name in node.inputs.values():
            if common.last_use.get(name) == number:
                buffers.pop(name, None)
    common.stats.add(seconds, rays, unlit)


def _adaptive_tile(common: _Common, tile: Tile) -> tuple[Mapping[str, NDArray[Any]], Kept]:
    """One tile's developed layers: few samples per pixel, and all of them in pixels where these few differ.

    The first samples also cover a border of one pixel, so that a pixel has the same neighbours in any tile.
    Each layer decides for itself, by the shapes and by its own values, independently of the other layers.
    """
    # The first samples, also of the border.
    plan, view, stats = common.plan, common.plan.view, common.stats
    coarse, bordered = view.coarse(), tile.grown(view.width, view.height)
    buffers, _ = _buffers(common, coarse, bordered)

    # The tile's pixels from these, and which of them need more.
    start = time.perf_counter()
    inside = (
        slice(tile.y - bordered.y, tile.y - bordered.y + tile.height),
        slice(tile.x - bordered.x, tile.x - bordered.x + tile.width),
    )
    coarse_pixels = _pixels(plan, buffers, coarse, bordered)
    out = {name: np.array(values[inside]) for name, values in coarse_pixels.items()}
    assert view.adaptive is not None
    differing = _differing(plan, buffers, coarse, bordered, view.adaptive.difference)
    to_refine = {name: mask[inside] for name, mask in differing.items()}
    down, across = np.nonzero(np.logical_or.reduce([*to_refine.values()]))
    stats.add({"film": time.perf_counter() - start}, {})

    # The remaining samples of those pixels, a batch at a time; each layer takes the pixels it refines.
    rest = view.rest()
    at_once = max(1, MAX_TILE_SAMPLES // rest.samples)
    for first in range(0, len(down), at_once):
        y, x = down[first : first + at_once], across[first : first + at_once]
        part = Scattered.at(x + tile.x, y + tile.y)
        others, _ = _buffers(common, rest, part)
        start = time.perf_counter()
        pixel = (part.rows - bordered.y) * bordered.width + part.columns - bordered.x
        joined = _joined(plan, buffers, others, pixel)
        stats.add({"film": time.perf_counter() - start}, {})
        for name, values in _pixels(plan, joined, view, part).items():
            refine = to_refine[name][y, x]
            out[name][y[refine], x[refine]] = values[0][refine]

    # Statistics.
    pixels, refined = tile.width * tile.height, len(down)
    taken = bordered.width * bordered.height * coarse.samples + refined * rest.samples
    stats.add({}, {}, {"samples": pixels * view.samples - taken})
    with stats.lock:
        stats.refined += refined

    start = time.perf_counter()
    developed = common.develop(tile, out)
    stats.add({"film": time.perf_counter() - start}, {})
    return developed, {}


def _joined(plan: Plan, coarse: Buffers, others: Buffers, pixel: NDArray[np.int64]) -> dict[str, Any]:
    """The buffers that the film reads, for some pixels: their first samples, followed by the others.

    Parameters
    ----------
    coarse : mapping
        The buffers of the first samples of a tile.
    others : mapping
        The buffers of the other samples of K pixels.
    pixel : (K,)
        Those pixels' numbers in the tile.
    """
    # The hits of the first samples in those pixels.
    first, last = coarse["samples"], others["samples"]
    count = first.per_pixel + last.per_pixel
    new_pixel = np.full(len(first.x), -1)
    new_pixel[pixel] = np.arange(len(pixel))
    coarse_pixel, coarse_sample = np.divmod(coarse["hits"].sample, first.per_pixel)
    kept = np.flatnonzero(new_pixel[coarse_pixel] >= 0)

    # Number all samples pixel by pixel.
    other_pixel, other_sample = np.divmod(others["hits"].sample, last.per_pixel)
    sample = np.concatenate(
        [
            new_pixel[coarse_pixel[kept]] * count + coarse_sample[kept],
            other_pixel * count + first.per_pixel + other_sample,
        ]
    ).astype(np.int32)

    # Join the buffers in that order.
    order = np.argsort(sample)
    points = np.concatenate(
        [each.points.reshape(-1, each.per_pixel, 2)[which] for each, which in ((first, pixel), (last, ...))],
        axis=1,
    )
    joined = {
        "hits": replace(others["hits"], sample=sample[order]),
        "samples": replace(last, points=points.reshape(-1, 2), per_pixel=count, first=None),
    }
    for name in {"alpha", *(layer.buffer for layer in plan.outputs)}:
        values = np.concatenate([coarse[name][kept], others[name]])
        joined[name] = column_major(values[order])
    return joined


def _differing(
    plan: Plan, buffers: Buffers, view: View, tile: Tile, difference: float
) -> dict[str, NDArray[np.bool_]]:
    """(rows, columns) by layer: the pixels that need more samples than the view has."""
    sample, shape = buffers["hits"].sample, (tile.height, tile.width)
    objects, normals = (buffers[name] for name in SHAPE)
    by_shape = differs_in_shape(objects, normals, sample, shape, view.samples)
    out = {}
    for name, buffer, data in [(layer.name, layer.buffer, layer.data) for layer in plan.outputs] + [
        ("alpha", "alpha", True)
    ]:
        out[name] = by_shape
        if not data:
            by_light = differs_in_light(buffers[buffer], sample, shape, view.samples, difference)
            out[name] = by_shape | by_light
    return out


def _pixels(plan: Plan, buffers: Buffers, view: View, tile: Tile) -> Planes:
    """The layers of a tile, reconstructed from the buffers of its samples."""
    sample = buffers["hits"].sample
    pixels = tile.width * tile.height
    out = {}
    for layer in plan.outputs:
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
