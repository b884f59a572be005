"""Runs a plan over tiles on a thread pool, frees buffers after their last use, counts and times each step."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import column_major
from illumcli.cache.recorder import NO_CACHE, BufferRecorder, Cache
from illumcli.film.adaptive import differs_in_light, differs_in_shape
from illumcli.film.reconstruct import pixel_means, pixel_nearest
from illumcli.film.tiles import MOST, Scattered, Tile, tiles
from illumcli.film.view import View
from illumcli.graph import Node
from illumcli.lights._incident import LitPoints
from illumcli.memory import keep_freed_memory
from illumcli.rays.embree import Interrupted
from illumcli.records import Record, Value
from illumcli.render_graph.build import SHAPE
from illumcli.render_graph.schedule import Plan

Planes: TypeAlias = dict[str, NDArray[Any]]  # layer -> (rows, columns, channels), float32 or, ids, uint32
Kept: TypeAlias = dict[str, NDArray[Any] | None]  # buffer -> what the store holds of it
Develop: TypeAlias = Callable[[Tile, Planes], Mapping[str, NDArray[Any]]]
"""A tile and its layers to what is wanted of it, (rows, columns, channels) by name; any thread."""


@dataclass(slots=True)
class RenderStats:
    """What was done: seconds, rays and lanes by step. Threads add under a lock."""

    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    rays: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    spared: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    """Points that a light does not reach, or does not reach freely: neither rays nor models see them. Samples
    of pixels that agree."""
    refined: int = 0
    """Pixels that wanted all their samples."""
    lock: threading.Lock = field(default_factory=threading.Lock)

    def add(
        self, seconds: Mapping[str, float], rays: Mapping[str, int], spared: Mapping[str, int] | None = None
    ) -> None:
        """Add one tile's figures."""
        with self.lock:
            for name, value in seconds.items():
                self.seconds[name] += value
            for name, count in rays.items():
                self.rays[name] += count
            for name, count in (spared or {}).items():
                self.spared[name] += count


class Band(Record):
    """Finished rows of a picture."""

    y: int
    layers: Mapping[str, NDArray[Any]]  # layer, or what was made of them -> (rows, width, channels)


class Run(Value):
    """What running nodes takes beside them: where buffers are kept, how many threads, who counts."""

    stats: RenderStats = field(default_factory=RenderStats)
    cache: Cache = NO_CACHE
    threads: int = 1


class _Common(Record):
    """What the tiles of a view have in common."""

    plan: Plan
    shared: Mapping[str, Any]
    stats: RenderStats
    stop: threading.Event
    recorder: BufferRecorder
    develop: Develop
    last_use: Mapping[str, int]


def _unchanged(tile: Tile, layers: Planes) -> Planes:
    return layers


def run_once(plan: Plan, run: Run) -> dict[str, Any]:
    """The buffers of the whole scene; those that do not need each other are computed side by side.

    Of several errors the one is raised that comes first in the plan.
    """
    pending: dict[str, Future[Any]] = {}

    def compute(node: Node) -> Any:
        inputs = {name: pending[name].result() for name in node.inputs.values()}  # submitted before it
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
    """Seconds of one processor that a buffer took, with all that had to be computed for it."""
    return sum(stats.seconds.get(need, 0.0) for need in plan.needed_for(name))


def bands(
    plan: Plan,
    shared: Mapping[str, Any],
    run: Run,
    done: Callable[[int], None] = lambda pixels: None,
    side: int | None = None,
    develop: Develop = _unchanged,
) -> Iterator[Band]:
    """A view's picture as bands of rows from the top, each as soon as its tiles are done.

    Bands hold the layers, or what `develop` makes of them tile by tile. The pixels do not depend on the
    threads, the `side` of tiles or the cache, where what is worth it is kept. When the consumer stops or is
    interrupted, tiles in flight end at their next node.

    Parameters
    ----------
    shared : mapping
        The buffers of the whole scene, as `run_once` returns them.
    done : callable
        Gets the number of pixels of each tile that is done.
    """
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

            # a row of tiles and some more are in flight, so that no thread waits for the consumer
            def submit() -> None:
                for tile in queue:
                    pending.append((tile, pool.submit(compute, common, tile)))
                    if len(pending) >= run.threads + 1 + len(rows[0]):
                        break

            submit()
            for row in rows:
                # join the tiles of a row in their order
                height = row[0].height
                band: dict[str, NDArray[Any]] = {}
                kept: dict[str, list[NDArray[Any] | None]] = defaultdict(list)
                for _ in row:
                    tile, future = pending.pop(0)
                    # a short wait, so that an interrupt reaches this thread
                    while not wait([future], timeout=0.2, return_when=FIRST_COMPLETED).done:
                        pass
                    layers, others = future.result()
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


def at_pixels(
    plan: Plan, shared: Mapping[str, Any], run: Run, x: NDArray[np.int64], y: NDArray[np.int64]
) -> Planes:
    """Layer -> (K, channels) at K pixels of a view: what `bands` computes there, and nothing else."""
    count = max(1, MOST // plan.view.samples)
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
    """What is wanted of one tile, and what is kept of its buffers."""
    buffers, kept = _buffers(common, common.plan.view, tile)
    start = time.perf_counter()
    out = common.develop(tile, _pixels(common.plan, buffers, common.plan.view, tile))
    common.stats.add({"film": time.perf_counter() - start}, {})
    return out, kept


def _buffers(common: _Common, view: View, tile: Tile) -> tuple[dict[str, Any], Kept]:
    """The buffers of one tile that the film reads, and what is kept of them all; `view` has its samples."""
    buffers: dict[str, Any] = {**common.shared, "view": view, "tile": tile}
    tracer = None
    if "tracer" in common.shared:
        tracer = buffers["tracer"] = common.shared["tracer"].counting(common.stop)
    seconds, rays, lanes, kept = {}, {}, {}, {}
    for number, step in enumerate(common.plan.tile):
        if common.stop.is_set():
            raise Interrupted
        start, before = time.perf_counter(), tracer.rays if tracer else 0
        made = buffers[step.output] = step.run(buffers)
        seconds[step.output] = time.perf_counter() - start
        if tracer and tracer.rays > before:
            rays[step.output] = tracer.rays - before
        if isinstance(made, LitPoints):
            lanes[step.output] = made.count - len(made.index)
        if step.output in common.recorder.names:
            kept[step.output] = common.recorder.take(step.output, buffers, tile)
        for name in step.inputs.values():
            if common.last_use.get(name) == number:
                buffers.pop(name, None)
    common.stats.add(seconds, rays, lanes)
    return buffers, kept


def _adaptive_tile(common: _Common, tile: Tile) -> tuple[Mapping[str, NDArray[Any]], Kept]:
    """What is wanted of one tile: of few samples, and of all of them where it differs among these.

    The few are taken of a border of one pixel too, so that a pixel sees the same neighbours in any tile. Each
    layer decides for itself, by the shapes seen and its own values: no layer depends on what others are asked
    for.
    """
    plan, view, stats = common.plan, common.plan.view, common.stats
    few, around = view.coarse(), tile.grown(view.width, view.height)
    buffers, _ = _buffers(common, few, around)
    start = time.perf_counter()
    own = (
        slice(tile.y - around.y, tile.y - around.y + tile.height),
        slice(tile.x - around.x, tile.x - around.x + tile.width),
    )
    out = {name: np.array(values[own]) for name, values in _pixels(plan, buffers, few, around).items()}
    differing = _differing(plan, buffers, few, around, view.adaptive.difference)
    which = {name: mask[own] for name, mask in differing.items()}
    wanted = np.logical_or.reduce([*which.values()])
    down, across = np.nonzero(wanted)
    stats.add({"film": time.perf_counter() - start}, {})
    rest = view.rest()
    some = max(1, MOST // rest.samples)
    for first in range(0, len(down), some):
        y, x = down[first : first + some], across[first : first + some]
        part = Scattered.at(x + tile.x, y + tile.y)
        others, _ = _buffers(common, rest, part)
        start = time.perf_counter()
        pixel = (part.rows - around.y) * around.width + part.columns - around.x
        joined = _joined(plan, buffers, others, pixel)
        stats.add({"film": time.perf_counter() - start}, {})
        for name, values in _pixels(plan, joined, view, part).items():
            mine = which[name][y, x]
            out[name][y[mine], x[mine]] = values[0][mine]
    pixels, refined = tile.width * tile.height, len(down)
    taken = around.width * around.height * few.samples + refined * rest.samples
    stats.add({}, {}, {"samples": pixels * view.samples - taken})
    with stats.lock:
        stats.refined += refined
    start = time.perf_counter()
    developed = common.develop(tile, out)
    stats.add({"film": time.perf_counter() - start}, {})
    return developed, {}


def _joined(
    plan: Plan, few: Mapping[str, Any], others: Mapping[str, Any], pixel: NDArray[np.int64]
) -> dict[str, Any]:
    """What the film reads of the pixels of these numbers: their few samples and after them the others."""
    first, last = few["samples"], others["samples"]
    count = first.per_pixel + last.per_pixel
    place = np.full(len(first.x), -1)
    place[pixel] = np.arange(len(pixel))
    own, sample = np.divmod(few["hits"].sample, first.per_pixel)
    among = np.flatnonzero(place[own] >= 0)
    pixel_of, other = np.divmod(others["hits"].sample, last.per_pixel)
    lane = np.concatenate(
        [place[own[among]] * count + sample[among], pixel_of * count + first.per_pixel + other]
    ).astype(np.int32)
    order = np.argsort(lane)
    points = np.concatenate(
        [each.points.reshape(-1, each.per_pixel, 2)[which] for each, which in ((first, pixel), (last, ...))],
        axis=1,
    )
    joined = {
        "hits": replace(others["hits"], sample=lane[order]),
        "samples": replace(last, points=points.reshape(-1, 2), per_pixel=count, first=None),
    }
    for name in {"alpha", *(layer.buffer for layer in plan.outputs)}:
        values = np.concatenate([few[name][among], others[name]])
        joined[name] = column_major(values[order])
    return joined


def _differing(
    plan: Plan, buffers: Mapping[str, Any], view: View, tile: Tile, difference: float
) -> dict[str, NDArray[np.bool_]]:
    """(rows, columns) by layer: where its pixels want more samples than the view has."""
    lane, shape = buffers["hits"].sample, (tile.height, tile.width)
    objects, normals = (buffers[name] for name in SHAPE)
    forms = differs_in_shape(objects, normals, lane, shape, view.samples)
    out = {}
    for name, buffer, data in [(layer.name, layer.buffer, layer.data) for layer in plan.outputs] + [
        ("alpha", "alpha", True)
    ]:
        out[name] = forms
        if not data:
            light = differs_in_light(buffers[buffer], lane, shape, view.samples, difference)
            out[name] = forms | light
    return out


def _pixels(plan: Plan, buffers: Mapping[str, Any], view: View, tile: Tile) -> Planes:
    lane = buffers["hits"].sample
    pixels = tile.width * tile.height
    out = {}
    for layer in plan.outputs:
        values = buffers[layer.buffer]
        if layer.per_pixel:
            made = values
        elif layer.data:
            made = pixel_nearest(values, lane, buffers["samples"].nearest(), pixels)
        else:
            made = pixel_means(values, lane, pixels, view.samples)
        out[layer.name] = made.reshape(tile.height, tile.width, -1)
    if "alpha" in buffers and "alpha" not in out:
        alpha = pixel_means(buffers["alpha"], lane, pixels, view.samples)
        out["alpha"] = alpha.reshape(tile.height, tile.width, 1)
    return out
