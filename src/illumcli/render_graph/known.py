"""Buffers of the whole scene that are needed before scheduling: object bounds, places of cameras."""

from __future__ import annotations

from dataclasses import replace

from illumcli.render_graph.build import Graph, Known
from illumcli.render_graph.cached import substitute_cached
from illumcli.render_graph.execute import Run, run_once
from illumcli.render_graph.schedule import Plan


def with_known(graph: Graph, name: str, run: Run, only_cached: bool = False) -> Graph:
    """The graph with the values of a buffer of the whole scene, and of all buffers computed for it.

    With `only_cached` nothing is computed: a buffer that is not cached stays unknown.
    """
    view = graph.views[0]  # no buffer of the whole scene depends on it
    part, lookup = substitute_cached(graph, [name], view, run.cache)
    if only_cached and name not in lookup.reused:
        return graph
    plan = Plan(part, (), view, tuple(part.topological_order([name])), (), lookup)
    buffers = run_once(plan, run)
    known = {each: Known(value, lookup.reused.get(each, "")) for each, value in buffers.items()}
    return replace(graph, known={**graph.known, **known})
