"""One tile of an adaptive picture: its pixels' centres, and all samples of the pixels that need them."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.cache.pixels import PixelRecorder, are_among
from illumcli.cache.recorder import Cache
from illumcli.film.tiles import MAX_TILE_SAMPLES, Scattered, Tile
from illumcli.graph import Buffers
from illumcli.layers import FIXED
from illumcli.records import Record
from illumcli.render_graph.build import READ
from illumcli.render_graph.build_adaptive import FITTED, decision
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
from illumcli.visibility.object_pixels import joined


class StartedAdaptive(Record):
    """An adaptive tile of which some nodes have run."""

    tile: Tile
    centres: StartedTile
    """One sample of each pixel of the tile and of a border, so that a pixel has the same neighbours in any
    tile."""
    edges: tuple[StartedTile, ...] = ()
    """All samples of the pixels that have edges, where obscurance is fitted to pixels."""

    @property
    def buffers(self) -> dict[str, Any]:
        """The buffers at the centres."""
        return self.centres.buffers

    @property
    def own(self) -> tuple[slice, slice]:
        """The rows and columns of the tile within its border."""
        return self.tile.within(self.centres.tile)

    def planes(self, name: str) -> NDArray[Any]:
        """(h, w) a buffer of pixels without its border."""
        bordered = self.centres.tile
        return np.asarray(self.buffers[name].reshape(bordered.height, bordered.width)[self.own])


def started_adaptive(common: TileContext, tile: Tile) -> StartedAdaptive:
    """A tile before anything that reads the pixels around it.

    Where obscurance is fitted to pixels, these are the centres, and all samples where a pixel has edges:
    whether other pixels need all samples depends on the layers, which a fit must not.
    """
    plan, view = common.plan, common.plan.view
    bordered = tile.grown(view.border, view.width, view.height)
    centres = StartedTile(plan, bordered, given_buffers(common, plan, bordered), {}, tile)
    started = StartedAdaptive(tile, centres)
    if not plan.before:
        return started

    # The edges, and the obscurance of the other centres.
    run_nodes(common, centres, range(plan.edges_by))
    has_edges = started.planes("edges")
    read = np.zeros((bordered.height, bordered.width), np.bool_)
    read[started.own] = ~has_edges
    centres.buffers[READ] = read.ravel()
    run_nodes(common, centres, range(plan.edges_by, plan.before))

    # All samples of pixels with edges.
    edges = []
    for pixels in _all_samples(common, tile, has_edges):
        run_nodes(common, pixels, range(pixels.plan.before))
        edges.append(pixels)
    parts = [each.buffers["object_pixels"] for each in (centres, *edges)]
    centres.buffers["object_pixels"] = joined(parts)
    return StartedAdaptive(tile, centres, tuple(edges))


def finished_adaptive(
    common: TileContext, started: StartedAdaptive
) -> tuple[Mapping[str, NDArray[Any]], Kept]:
    """One tile's developed layers: of its pixels' centres, and of all samples where these are not enough.

    Each layer decides for itself, independently of the other layers.
    """
    plan, all_samples, stats = common.plan, common.plan.all_samples, common.stats
    assert all_samples is not None
    tile, centres, own = started.tile, started.centres, started.own
    buffers, bordered = started.buffers, centres.tile

    # What decides about the pixels.
    run_nodes(common, centres, range(plan.before, plan.decided_by))
    means = [*all_samples.outputs, FIXED["alpha"]]
    refined = {layer.name: started.planes(decision(layer)) for layer in means if decision(layer) in buffers}

    # The layers at the centres; traced obscurance only where some layer shows it.
    read = np.zeros((bordered.height, bordered.width), np.bool_)
    read[own] = ~np.logical_and.reduce([refined[layer.name] for layer in all_samples.outputs])
    buffers[READ] = read.ravel()
    run_nodes(common, centres, range(plan.decided_by, len(plan.tile)))
    start = time.perf_counter()
    layers = {name: np.array(values[own]) for name, values in pixel_layers(plan, buffers, bordered).items()}
    stats.add({"film": time.perf_counter() - start}, {})

    # Pixels that an earlier picture did not read the traced obscurance of.
    fitted = {FITTED: buffers[FITTED]} if FITTED in buffers else {}
    if not fitted:
        everywhere = np.ones((tile.height, tile.width), np.bool_)
        for pixels in _lacking(common, started, read):
            run_nodes(common, pixels, range(len(pixels.plan.tile)))
            _show(common, tile, pixels, layers, dict.fromkeys(layers, everywhere))

    # All samples of the pixels that some layer needs them for.
    wanted = np.logical_or.reduce([*refined.values()])
    further = wanted & ~started.planes("edges") if started.edges else wanted
    for has_begun, group in ((True, started.edges), (False, _all_samples(common, tile, further))):
        for pixels in group:
            pixels.buffers.update(fitted)
            first = pixels.plan.before if has_begun else 0
            run_nodes(common, pixels, [each for each in pixels.plan.with_fit if each >= first])
            _show(common, tile, pixels, layers, refined)

    count = int(np.count_nonzero(wanted))
    stats.add({}, {}, {"samples": (wanted.size - count) * (all_samples.view.samples - 1)}, count)
    if plan.replicates is not None:
        layers["error"] = _error(common, plan.replicates, tile, layers)
        if FIXED["beauty"] not in plan.outputs:  # it was computed for its error alone
            layers = {layer.name: layers[layer.name] for layer in plan.outputs}
    start = time.perf_counter()
    developed = common.develop(tile, layers)
    stats.add({"film": time.perf_counter() - start}, {})
    return developed, centres.kept


def _error(common: TileContext, plan: Plan, tile: Tile, layers: Planes) -> NDArray[np.float32]:
    """The layer `error` of a tile, from replicates with all samples, which see what one sample misses."""
    buffers, _ = tile_buffers(common, plan, tile)
    samples, second = (buffers[name] for name in REPLICATED)
    background = plan.graph.scene.film.background or (0.0, 0.0, 0.0)
    first = pixel_luminance(background, layers["beauty"], layers["alpha"])
    error = standard_error(plan.view, tile, samples, first, second)
    return error.reshape(tile.height, tile.width, 1)


def _lacking(common: TileContext, started: StartedAdaptive, read: NDArray[np.bool_]) -> Iterator[StartedTile]:
    """The centres that are read and have no obscurance, since NaN was cached; no node of them has run."""
    if "obscurance" not in started.buffers:
        return
    lacks = np.zeros(read.size, np.bool_)
    lacks[started.buffers["hits"].sample] = np.isnan(started.buffers["obscurance"])
    which = (lacks.reshape(read.shape) & read)[started.own]
    if which.any():
        plan, _, shared = common.uncached()
        yield from _scattered(common, started.tile, which, (plan, shared))


def _all_samples(common: TileContext, tile: Tile, which: NDArray[np.bool_]) -> Iterator[StartedTile]:
    """All samples of some pixels, of which no node has run: first where their buffers are cached."""
    plan = common.plan.all_samples
    assert plan is not None
    y, x = np.nonzero(which)
    cached = np.zeros_like(which)
    cached[y, x] = are_among((y + tile.y) * plan.view.width + x + tile.x, common.held)
    yield from _scattered(common, tile, cached, (plan, common.shared))
    if (which & ~cached).any():
        _, plan, shared = common.uncached()
        yield from _scattered(common, tile, which & ~cached, (plan, shared), common.pixel_recorder)


def _scattered(
    common: TileContext,
    tile: Tile,
    which: NDArray[np.bool_],
    planned: tuple[Plan, Buffers],
    pixel_recorder: PixelRecorder | None = None,
) -> Iterator[StartedTile]:
    """Some pixels of a tile, as many at once as a tile has samples, with the plan and its buffers."""
    plan, shared = planned
    down, across = np.nonzero(which)
    at_once = max(1, MAX_TILE_SAMPLES // plan.view.samples)
    for first in range(0, len(down), at_once):
        y, x = down[first : first + at_once], across[first : first + at_once]
        pixels = Scattered.at(x + tile.x, y + tile.y)
        buffers = given_buffers(common, plan, pixels, shared)
        yield StartedTile(plan, pixels, buffers, {}, pixel_recorder=pixel_recorder)


def _show(
    common: TileContext,
    tile: Tile,
    pixels: StartedTile,
    layers: Planes,
    masks: Mapping[str, NDArray[np.bool_]],
) -> None:
    """Set layers of a tile at some of its pixels, each where its mask is True."""
    start = time.perf_counter()
    column, row = pixels.tile.pixels()
    x, y = column - tile.x, row - tile.y
    for name, values in pixel_layers(pixels.plan, pixels.buffers, pixels.tile).items():
        mine = masks[name][y, x]
        layers[name][y[mine], x[mine]] = values[0][mine]
    common.stats.add({"film": time.perf_counter() - start}, {})


def pixel_recorder_of(plan: Plan, cache: Cache) -> PixelRecorder | None:
    """What keeps the pixels of an adaptive picture that have all samples, where something is kept."""
    others = plan.all_samples
    if others is None or plan.rows is not None or (cache.store is None and cache.memory is None):
        return None
    return PixelRecorder(cache.store, cache.memory, others.lookup.keeps, others.lookup.pixels, others.view)
