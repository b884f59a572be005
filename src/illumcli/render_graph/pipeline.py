"""From a graph to a plan: the steps `cull -> substitute_cached -> schedule` in their order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from illumcli.cache.recorder import Cache
from illumcli.film.view import View
from illumcli.layers import Layer
from illumcli.render_graph.build import Graph
from illumcli.render_graph.build_adaptive import FITTED
from illumcli.render_graph.cached import substitute_cached
from illumcli.render_graph.culling import cull, find_bounds
from illumcli.render_graph.execute import Run
from illumcli.render_graph.framing import place_cameras
from illumcli.render_graph.schedule import Plan, needed_buffers, schedule


def place_and_cull(graph: Graph, outputs: Sequence[Layer], run: Run, only_cached: bool = False) -> Graph:
    """The graph with its cameras placed and without objects that cannot affect any view.

    With `only_cached` nothing is computed: cameras and objects whose bounds are not cached stay as they are.
    """
    graph = place_cameras(graph, run, only_cached)
    graph, bounds = find_bounds(graph, outputs, run, only_cached)
    memory = run.cache.memory
    graph = cull(graph, outputs, bounds, frozenset() if memory is None else memory.needed)
    if memory is not None:
        memory.needed |= set(range(len(graph.scene.objects))).difference(graph.culled)
    if bounds is None:
        return graph
    polygons = int(bounds.objects.polygons[list(graph.culled)].sum())
    if polygons:
        run.stats.add({}, {}, {"polygons": polygons})
    return graph


def plan_view(
    graph: Graph,
    outputs: Sequence[Layer],
    view: View,
    cache: Cache,
    look: bool = False,
    rows: tuple[int, int] | None = None,
) -> Plan:
    """The plan of one view, or of some of its rows, in which cached buffers are loaded.

    With `look` nothing is read.

    Buffers in memory that are of other tiles are dropped: another layer, reconstruction or reach of the pixel
    filter may change the tiles.
    """
    while True:
        plan = replace(_plan_view(graph, outputs, view, cache, look), rows=rows)
        if cache.memory is None or not plan.lookup.tiles:
            return plan
        needed = set(plan.tiles_of_buffers())
        others = [key for key, tiles in plan.lookup.tiles.items() if not needed.issubset(tiles)]
        if not others:
            return plan
        cache.memory.forget(others)


def _plan_view(graph: Graph, outputs: Sequence[Layer], view: View, cache: Cache, look: bool) -> Plan:
    buffers = needed_buffers(graph, outputs, [view])
    if view.adaptive is None:
        graph, lookup = substitute_cached(graph, buffers, view, cache, look)
        return schedule(graph, outputs, view, lookup)

    # An adaptive picture: the centres of all pixels, and all samples of some, which share fitted obscurance.
    centres, lookup = substitute_cached(graph, buffers, view.centres(), cache, look)
    all_samples = None
    if means := [layer for layer in outputs if not layer.data]:
        of_all = view.all_samples()
        fitted = {name: node for name, node in centres.loaders.items() if name == FITTED}
        graph = replace(graph, loaders=fitted)
        needed = needed_buffers(graph, means, [of_all])
        loaded, of_pixels = substitute_cached(graph, needed, of_all, cache, look, tiles="some")
        all_samples = schedule(loaded, means, of_all, of_pixels)
    return schedule(centres, outputs, view, lookup, all_samples)
