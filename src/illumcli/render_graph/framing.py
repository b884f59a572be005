"""Places cameras that fit an object: their position depends on its mesh, so it is computed first."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from illumcli.film.view import View
from illumcli.rays.camera import Placement
from illumcli.render_graph.build import Graph
from illumcli.render_graph.execute import Run
from illumcli.render_graph.known import with_known


def place_cameras(graph: Graph, run: Run, only_cached: bool = False) -> Graph:
    """The graph with the cameras of its views placed.

    With `only_cached` no mesh is read: a camera whose placement is not cached stays where the scene has it.
    """
    views = []
    for view in graph.views:
        if view.camera.fit is not None:
            graph = with_known(graph, f"camera:{view.name}", run, only_cached)
            placement = graph.known.get(f"camera:{view.name}")
            view = view if placement is None else placed(view, placement.value)
        views.append(view)
    return replace(graph, views=tuple(views))


def placed(view: View, placement: Placement) -> View:
    """The view with its camera at a placement."""
    position, target, extent = placement
    changes: dict[str, Any] = {"position": position, "target": target, "fit": None}
    if extent is not None:
        changes["extent"] = extent
    return replace(view, camera=view.camera.model_copy(update=changes))
