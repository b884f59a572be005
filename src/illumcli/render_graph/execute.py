"""Runs a plan over tiles on a pool of threads, frees dead buffers, counts and times each step."""

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
from illumcli.film.adaptive import differs_in_light, differs_in_shape
from illumcli.film.reconstruct import pixel_means, pixel_nearest
from illumcli.film.tiles import MOST, Scattered, Tile
from illumcli.film.tiles import tiles as cut
from illumcli.film.view import View
from illumcli.graph import Node
from illumcli.lights.incident import LitPoints
from illumcli.memory import keep_freed_memory
from illumcli.rays.embree import Interrupted
from illumcli.records import Record
from illumcli.render_graph.build import SHAPE
from illumcli.render_graph.cached import Artifacts, Keeper
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


class _Common(Record):
    """What the tiles of a picture have in common."""

    plan: Plan
    shared: Mapping[str, Any]
    view: View
    tally: RenderStats
    stop: threading.Event
    keeper: Keeper
    develop: Develop
    last_use: Mapping[str, int]


def _as_they_are(tile: Tile, layers: Planes) -> Planes:
    return layers


def run_once(
    plan: Plan, tally: RenderStats, artifacts: Artifacts | None = None, threads: int = 1
) -> dict[str, Any]:
    """The buffers that no tile changes; those that do not need each other are made beside each other.

    Of several faults the one is raised that comes first in the plan.
    """
    pending: dict[str, Future[Any]] = {}

    def make(step: Node) -> Any:
        needs = {name: pending[name].result() for name in step.inputs.values()}  # handed out before it
        start = time.perf_counter()
        made = step.run(needs)
        tally.add({step.output: time.perf_counter() - start}, {})
        return made

    buffers: dict[str, Any] = {}
    pool = ThreadPoolExecutor(threads, thread_name_prefix="once")
    try:
        for step in plan.once:
            pending[step.output] = pool.submit(make, step)
        for name, future in pending.items():
            buffers[name] = future.result()
            if artifacts is not None and name in plan.keeps:
                artifacts.keep_once(name, plan.keeps[name], buffers[name], _cost(plan, name, tally))
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
    return buffers


def _cost(plan: Plan, name: str, tally: RenderStats) -> float:
    """Seconds of one processor that a buffer took, with all that had to be made for it."""
    return sum(tally.seconds.get(need, 0.0) for need in plan.needed_for(name))


def bands(
    plan: Plan,
    shared: Mapping[str, Any],
    view: View,
    threads: int,
    tally: RenderStats,
    done: Callable[[int], None] = lambda pixels: None,
    side: int | None = None,
    artifacts: Artifacts | None = None,
    develop: Develop = _as_they_are,
) -> Iterator[Band]:
    """A view's picture as bands of rows from the top, each as soon as its tiles are done.

    Bands hold the layers, or what `develop` makes of them tile by tile. The pixels do not depend on
    `threads`, `side` or `artifacts`, where what is worth it is kept. When the consumer stops or is
    interrupted, tiles in flight end at their next step.
    """
    adaptive = view.is_adaptive
    first = view.coarse() if adaptive else view
    tiles = cut(view.width, view.height, plan.tile_side(first, side), first.samples)
    stop = threading.Event()
    ahead = threads + 1
    keeper = Keeper(artifacts or Artifacts(), {} if adaptive else plan.keeps, view)
    common = _Common(plan, shared, view, tally, stop, keeper, develop, plan.last_use())
    make = _adaptive_tile if adaptive else _tile
    keep_freed_memory()
    with ThreadPoolExecutor(threads, thread_name_prefix="tile") as pool:
        try:
            pending: list[tuple[Tile, Future[tuple[Mapping[str, NDArray[Any]], Kept]]]] = []
            queue = iter([tile for row in tiles for tile in row])

            def submit() -> None:
                for tile in queue:
                    pending.append((tile, pool.submit(make, common, tile)))
                    if len(pending) >= ahead + len(tiles[0]):
                        break

            submit()
            for row in tiles:
                height = row[0].height
                whole: dict[str, NDArray[Any]] = {}
                kept: dict[str, list[NDArray[Any] | None]] = defaultdict(list)
                for _ in row:
                    tile, future = pending.pop(0)
                    # a short wait, so that an interrupt reaches this thread
                    while not wait([future], timeout=0.2, return_when=FIRST_COMPLETED).done:
                        pass
                    layers, others = future.result()
                    for name, values in layers.items():
                        if name not in whole:
                            whole[name] = np.empty((height, view.width, values.shape[2]), values.dtype)
                        whole[name][:, tile.x : tile.x + tile.width] = values
                    for name, packed in others.items():
                        kept[name].append(packed)
                    done(tile.width * tile.height)
                    submit()
                keeper.write(kept)
                yield Band(row[0].y, whole)
            keeper.finish({name: _cost(plan, name, tally) for name in plan.keeps})
        finally:
            stop.set()
            keeper.discard()
            pool.shutdown(wait=True, cancel_futures=True)


def at_pixels(
    plan: Plan,
    shared: Mapping[str, Any],
    view: View,
    x: NDArray[np.int64],
    y: NDArray[np.int64],
    threads: int,
    tally: RenderStats,
) -> Planes:
    """Layer -> (K, channels) at K pixels of a view: what `bands` makes there, and nothing else is made."""
    some = max(1, MOST // view.samples)
    tiles = [Scattered.at(x[a : a + some], y[a : a + some]) for a in range(0, len(x), some)]
    stop, keeper = threading.Event(), Keeper(Artifacts(), {}, view)
    common = _Common(plan, shared, view, tally, stop, keeper, _as_they_are, plan.last_use())
    with ThreadPoolExecutor(threads, thread_name_prefix="tile") as pool:
        try:
            made = [pool.submit(_tile, common, tile) for tile in tiles]
            parts = [future.result()[0] for future in made]
        finally:
            stop.set()
            pool.shutdown(wait=True, cancel_futures=True)
    return {name: np.concatenate([part[name][0] for part in parts]) for name in parts[0]}


def _tile(common: _Common, tile: Tile) -> tuple[Mapping[str, NDArray[Any]], Kept]:
    """What is wanted of one tile, and what is kept of its buffers."""
    buffers, kept = _made(common, common.view, tile)
    start = time.perf_counter()
    out = common.develop(tile, _pixels(common.plan, buffers, common.view, tile))
    common.tally.add({"film": time.perf_counter() - start}, {})
    return out, kept


def _made(common: _Common, view: View, tile: Tile) -> tuple[dict[str, Any], Kept]:
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
        if step.output in common.keeper.names:
            kept[step.output] = common.keeper.take(step.output, buffers, tile)
        for name in step.inputs.values():
            if common.last_use.get(name) == number:
                buffers.pop(name, None)
    common.tally.add(seconds, rays, lanes)
    return buffers, kept


def _adaptive_tile(common: _Common, tile: Tile) -> tuple[Mapping[str, NDArray[Any]], Kept]:
    """What is wanted of one tile: of few samples, and of all of them where it differs among these.

    The few are taken of a border of one pixel too, so that a pixel sees the same neighbours in any tile. Each
    layer decides for itself, by the shapes seen and its own values: no layer depends on what others are asked
    for.
    """
    plan, view, tally = common.plan, common.view, common.tally
    few, around = view.coarse(), tile.grown(view.width, view.height)
    buffers, _ = _made(common, few, around)
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
    tally.add({"film": time.perf_counter() - start}, {})
    rest = view.rest()
    some = max(1, MOST // rest.samples)
    for first in range(0, len(down), some):
        y, x = down[first : first + some], across[first : first + some]
        part = Scattered.at(x + tile.x, y + tile.y)
        others, _ = _made(common, rest, part)
        start = time.perf_counter()
        pixel = (part.rows - around.y) * around.width + part.columns - around.x
        joined = _joined(plan, buffers, others, pixel)
        tally.add({"film": time.perf_counter() - start}, {})
        for name, values in _pixels(plan, joined, view, part).items():
            mine = which[name][y, x]
            out[name][y[mine], x[mine]] = values[0][mine]
    pixels, refined = tile.width * tile.height, len(down)
    taken = around.width * around.height * few.samples + refined * rest.samples
    tally.add({}, {}, {"samples": pixels * view.samples - taken})
    with tally.lock:
        tally.refined += refined
    start = time.perf_counter()
    developed = common.develop(tile, out)
    tally.add({"film": time.perf_counter() - start}, {})
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
    for name in {"alpha", *(layer.buffer for layer in plan.layers)}:
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
    for name, buffer, data in [(layer.name, layer.buffer, layer.data) for layer in plan.layers] + [
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
    for layer in plan.layers:
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
