"""Runs a plan over tiles on a pool of threads, frees dead buffers, counts and times each step."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.film.film import pixel_means, pixel_nearest
from illumcli.plan.plan import Plan
from illumcli.plan.recipes import View
from illumcli.plan.stages import Tile
from illumcli.rays.tracer import Interrupted

LANES = 1 << 14
"""Samples per tile: a dozen buffers of that many stay in a core's cache of 1 MiB."""


@dataclass(slots=True)
class Tally:
    """What was done: seconds, rays and lanes by step. Threads add under a lock."""

    seconds: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    rays: dict[str, int] = field(default_factory=lambda: defaultdict(int))
    lock: threading.Lock = field(default_factory=threading.Lock)

    def add(self, seconds: Mapping[str, float], rays: Mapping[str, int]) -> None:
        """Add one tile's figures."""
        with self.lock:
            for name, value in seconds.items():
                self.seconds[name] += value
            for name, count in rays.items():
                self.rays[name] += count


@dataclass(frozen=True, slots=True, eq=False)
class Band:
    """Finished rows of a picture."""

    y: int
    layers: Mapping[str, NDArray[np.float32]]  # layer -> (rows, width, channels)


def run_once(plan: Plan, tally: Tally) -> dict[str, Any]:
    """The buffers that no tile changes."""
    buffers: dict[str, Any] = {}
    for step in plan.once:
        start = time.perf_counter()
        buffers[step.makes] = step.make(buffers)
        tally.add({step.makes: time.perf_counter() - start}, {})
    return buffers


def tile_side(samples: int) -> int:
    """Pixels along a square tile's side, a power of two."""
    return int(max(4, 2 ** int(np.log2(max(1, LANES / samples)) / 2)))


def bands(
    plan: Plan,
    shared: Mapping[str, Any],
    view: View,
    threads: int,
    tally: Tally,
    done: Callable[[int], None] = lambda pixels: None,
    side: int | None = None,
) -> Iterator[Band]:
    """A view's picture as bands of rows from the top, each as soon as its tiles are done.

    The pixels do not depend on `threads` or `side`. When the consumer stops or is interrupted, tiles in
    flight end at their next step.
    """
    side = side or tile_side(view.samples)
    stop = threading.Event()
    tiles = [
        [
            Tile(x, y, min(side, view.width - x), min(side, view.height - y))
            for x in range(0, view.width, side)
        ]
        for y in range(0, view.height, side)
    ]
    ahead = threads + 1
    last_use = plan.last_use()
    covered = any(step.makes == "alpha" for step in plan.tile)
    with ThreadPoolExecutor(threads, thread_name_prefix="tile") as pool:
        try:
            pending: list[tuple[Tile, Future[dict[str, NDArray[np.float32]]]]] = []
            queue = iter([tile for row in tiles for tile in row])

            def submit() -> None:
                for tile in queue:
                    pending.append(
                        (tile, pool.submit(_tile, plan, shared, view, tile, last_use, tally, stop))
                    )
                    if len(pending) >= ahead + len(tiles[0]):
                        break

            submit()
            for row in tiles:
                height = row[0].height
                whole = {
                    layer.name: np.empty((height, view.width, len(layer.channels)), F)
                    for layer in plan.layers
                }
                if covered:
                    whole.setdefault("alpha", np.empty((height, view.width, 1), F))
                for _ in row:
                    tile, future = pending.pop(0)
                    # a short wait, so that an interrupt reaches this thread
                    while not wait([future], timeout=0.2, return_when=FIRST_COMPLETED).done:
                        pass
                    for name, values in future.result().items():
                        whole[name][:, tile.x : tile.x + tile.width] = values
                    done(tile.width * tile.height)
                    submit()
                yield Band(row[0].y, whole)
        finally:
            stop.set()
            pool.shutdown(wait=True, cancel_futures=True)


def _tile(
    plan: Plan,
    shared: Mapping[str, Any],
    view: View,
    tile: Tile,
    last_use: Mapping[str, int],
    tally: Tally,
    stop: threading.Event,
) -> dict[str, NDArray[np.float32]]:
    """Every layer of one tile, (rows, columns, channels) each."""
    buffers: dict[str, Any] = {**shared, "view": view, "tile": tile}
    tracer = buffers["tracer"] = shared["tracer"].counting(stop)
    seconds, rays = {}, {}
    for number, step in enumerate(plan.tile):
        if stop.is_set():
            raise Interrupted
        start, before = time.perf_counter(), tracer.rays
        buffers[step.makes] = step.make(buffers)
        seconds[step.makes] = time.perf_counter() - start
        if tracer.rays > before:
            rays[step.makes] = tracer.rays - before
        for name in step.needs.values():
            if last_use.get(name) == number:
                buffers.pop(name, None)
    start = time.perf_counter()
    out = _pixels(plan, buffers, tile)
    seconds["film"] = time.perf_counter() - start
    tally.add(seconds, rays)
    return out


def _pixels(plan: Plan, buffers: Mapping[str, Any], tile: Tile) -> dict[str, NDArray[np.float32]]:
    samples, lane = buffers["samples"], buffers["hits"].lane
    pixels = tile.width * tile.height
    out = {}
    for layer in plan.layers:
        values = buffers[layer.buffer]
        if layer.data:
            made = pixel_nearest(values, lane, samples.nearest, pixels)
        else:
            made = pixel_means(values, lane, pixels, samples.per_pixel)
        out[layer.name] = made.reshape(tile.height, tile.width, -1)
    if "alpha" in buffers and "alpha" not in out:
        alpha = pixel_means(buffers["alpha"], lane, pixels, samples.per_pixel)
        out["alpha"] = alpha.reshape(tile.height, tile.width, 1)
    return out
