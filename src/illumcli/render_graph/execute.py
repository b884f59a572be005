"""Runs a plan: the nodes of the whole scene once, then the tiles of a view, on a thread pool."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from illumcli.cache.recorder import NO_CACHE, BufferRecorder, Cache
from illumcli.film.tiles import MAX_TILE_SAMPLES, Scattered, Tile
from illumcli.graph import Buffers, Node
from illumcli.memory import keep_freed_memory
from illumcli.records import Record, Value
from illumcli.render_graph.adaptive_tile import (
    StartedAdaptive,
    finished_adaptive,
    pixel_recorder_of,
    started_adaptive,
)
from illumcli.render_graph.build import SURROUNDINGS
from illumcli.render_graph.build_adaptive import FITTED
from illumcli.render_graph.schedule import Plan
from illumcli.render_graph.shadow_batches import with_shadow_batches
from illumcli.render_graph.tile_nodes import (
    Develop,
    Kept,
    Planes,
    RenderStats,
    StartedTile,
    TileContext,
    developed_layers,
    given_buffers,
    run_nodes,
    tile_buffers,
)
from illumcli.visibility.object_pixels import FittedPixels, ObjectPixels, within
from illumcli.visibility.reconstruction import MARGIN

Result = TypeVar("Result")
POLL_INTERVAL = 0.02
"""Between two looks whether a tile is computed or the run shall end [seconds]."""


class Band(Record):
    """Finished rows of an image."""

    y: int
    layers: Mapping[str, NDArray[Any]]  # layers, or the arrays developed from them: (rows, width, channels)


class Run(Value):
    """How nodes are run: the statistics they add to, the cache and the number of threads."""

    stats: RenderStats = field(default_factory=RenderStats)
    cache: Cache = NO_CACHE
    threads: int = 1


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
    """The image of a view, or the plan's rows of it, as bands from the top, each as soon as its tiles are
    finished.

    Bands hold the layers, or the arrays that `develop` computes from them tile by tile. The pixels do not
    depend on the number of threads, the `side` of tiles or the cache; buffers that are worth it are cached.
    If the consumer stops or is interrupted, tiles in progress end at their next node.

    Parameters
    ----------
    shared : mapping
        The buffers of the whole scene, from `run_once`.
    done : callable
        Called with the number of pixels of each finished tile, and with 0 many times a second while none is;
        its exceptions end the run.

    Raises
    ------
    ValueError
        Some rows of a plan whose pixels read those around them.
    """
    view = plan.view
    if plan.before and plan.rows is not None:
        raise ValueError("pictures of which pixels read those around them are rendered whole")
    rows = plan.rows_of_tiles(side)
    keeps = plan.lookup.keeps if plan.rows is None else {}  # buffers of tiles are kept of whole pictures
    recorder, stop = BufferRecorder(run.cache, keeps, view), threading.Event()
    plan = with_shadow_batches(plan)
    common = TileContext(
        plan, shared, run.stats, stop, recorder, develop, pixel_recorder_of(plan, run.cache), run.cache
    )
    keep_freed_memory()
    with ThreadPoolExecutor(run.threads, thread_name_prefix="tile") as pool:
        try:
            pending: list[tuple[Tile, Future[tuple[Mapping[str, NDArray[Any]], Kept]]]] = []
            queue = iter([tile for row in rows for tile in row])
            ahead = _Ahead(common, rows, pool, done)

            # Keep a row of tiles and a few more in progress, so that no thread waits for the consumer.
            def submit() -> None:
                for tile in queue:
                    future = ahead.submit(tile) if plan.before else pool.submit(_tile, common, tile)
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
                    layers, others = _result(future, done)
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
            recorder.finish({name: _cost(plan, name, run.stats) for name in recorder.names})
            if common.fits:
                whole = FittedPixels.joined(common.fits)
                run.cache.keep(FITTED, keeps[FITTED], whole, _cost(plan, FITTED, run.stats))
            if plan.all_samples is not None and common.pixel_recorder is not None:
                names = plan.all_samples.lookup.keeps
                common.pixel_recorder.finish({name: _cost(plan, name, run.stats) for name in names})
        finally:
            stop.set()
            recorder.discard()
            pool.shutdown(wait=True, cancel_futures=True)


def _result(future: Future[Result], done: Callable[[int], None]) -> Result:
    """What a thread computed; waits in short steps, so that an interrupt or `done` can end it."""
    while not wait([future], timeout=POLL_INTERVAL, return_when=FIRST_COMPLETED).done:
        done(0)
    return future.result()


class _Ahead:
    """Runs the first nodes of tiles some rows ahead of the others, which read the pixels around."""

    def __init__(
        self,
        common: TileContext,
        rows: Sequence[Sequence[Tile]],
        pool: ThreadPoolExecutor,
        done: Callable[[int], None],
    ) -> None:
        self.common, self.rows, self.pool, self.done = common, rows, pool, done
        self.first_row, self.next_row = 0, 0
        self.started: dict[Tile, Future[StartedTile | StartedAdaptive]] = {}
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
                    self.pixels[each] = _result(self.started[each], self.done).buffers["object_pixels"]
                if (
                    each != tile
                    and each.x < tile.x + tile.width + MARGIN
                    and each.x + each.width > tile.x - MARGIN
                ):
                    parts.append(self.pixels[each])
        own = _result(self.started.pop(tile), self.done)
        return self.pool.submit(_last_nodes, self.common, own, within(parts, tile, MARGIN))


def _first_nodes(common: TileContext, tile: Tile) -> StartedTile | StartedAdaptive:
    """A tile after the nodes whose results the tiles around read."""
    if common.plan.all_samples:
        return started_adaptive(common, tile)
    started = StartedTile(common.plan, tile, given_buffers(common, common.plan, tile), {})
    run_nodes(common, started, range(common.plan.before))
    return started


def _last_nodes(
    common: TileContext, started: StartedTile | StartedAdaptive, around: ObjectPixels
) -> tuple[Mapping[str, NDArray[Any]], Kept]:
    """One tile's developed layers, and its buffers for the cache; `around` are the pixels around it."""
    started.buffers[SURROUNDINGS] = around
    if isinstance(started, StartedAdaptive):
        return finished_adaptive(common, started)
    run_nodes(common, started, range(common.plan.before, len(common.plan.tile)))
    return developed_layers(common, started.tile, started.buffers), started.kept


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
    common = TileContext(plan, shared, run.stats, stop, recorder, _unchanged)
    with ThreadPoolExecutor(run.threads, thread_name_prefix="tile") as pool:
        try:
            pending = [pool.submit(_tile, common, tile) for tile in pieces]
            parts = [future.result()[0] for future in pending]
        finally:
            stop.set()
            pool.shutdown(wait=True, cancel_futures=True)
    return {name: np.concatenate([part[name][0] for part in parts]) for name in parts[0]}


def _tile(common: TileContext, tile: Tile) -> tuple[Mapping[str, NDArray[Any]], Kept]:
    """One tile's developed layers, and its buffers for the cache."""
    if common.plan.all_samples:
        return finished_adaptive(common, started_adaptive(common, tile))
    buffers, kept = tile_buffers(common, common.plan, tile)
    return developed_layers(common, tile, buffers), kept
