"""One tile of an adaptive picture: its pixels' centres, and all samples of the pixels that need them."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from illumcli.cache.pixels import PixelRecorder, are_among
from illumcli.cache.recorder import Cache
from illumcli.film.tiles import MAX_TILE_SAMPLES, Scattered, Tile
from illumcli.graph import Buffers
from illumcli.layers import FIXED
from illumcli.render_graph.build import READ
from illumcli.render_graph.build_adaptive import decision
from illumcli.render_graph.replicates import REPLICATED, pixel_luminance, standard_error
from illumcli.render_graph.schedule import Plan
from illumcli.render_graph.tile_nodes import (
    Kept,
    Planes,
    StartedTile,
    TileContext,
    given_buffers,
    pixel_layers,
    run_nodes,
    tile_buffers,
)


def adaptive_tile(common: TileContext, tile: Tile) -> tuple[Mapping[str, NDArray[Any]], Kept]:
    """One tile's developed layers: of its pixels' centres, and of all samples where these are not enough.

    Each layer decides for itself, independently of the other layers.
    """
    plan, all_samples, stats = common.plan, common.plan.all_samples, common.stats
    assert all_samples is not None

    # What decides about the pixels, with a border, so that a pixel has the same neighbours in any tile.
    view = plan.view
    bordered = tile.grown(view.border, view.width, view.height)
    own, shape = tile.within(bordered), (bordered.height, bordered.width)
    started = StartedTile(plan, bordered, given_buffers(common, plan, bordered), {}, tile)
    run_nodes(common, started, range(plan.decided_by))
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
    run_nodes(common, started, range(plan.decided_by, len(plan.tile)))
    start = time.perf_counter()
    layers = {name: np.array(values[own]) for name, values in pixel_layers(plan, buffers, bordered).items()}
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


def _error(common: TileContext, plan: Plan, tile: Tile, layers: Planes) -> NDArray[np.float32]:
    """The layer `error` of a tile, from replicates with all samples, which see what one sample misses."""
    buffers, _ = tile_buffers(common, plan, tile)
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
    common: TileContext,
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
        started = StartedTile(plan, pixels, given_buffers(common, plan, pixels, shared), {})
        run_nodes(common, started, range(len(plan.tile)), recorder)
        start = time.perf_counter()
        for name, values in pixel_layers(plan, started.buffers, pixels).items():
            mine = masks[name][y, x]
            layers[name][y[mine], x[mine]] = values[0][mine]
        common.stats.add({"film": time.perf_counter() - start}, {})


def pixel_recorder_of(plan: Plan, cache: Cache) -> PixelRecorder | None:
    """What keeps the pixels of an adaptive picture that have all samples, where something is kept."""
    others = plan.all_samples
    if others is None or (cache.store is None and cache.memory is None):
        return None
    return PixelRecorder(cache.store, cache.memory, others.lookup.keeps, others.lookup.pixels, others.view)
