"""Cameras that an object is to fill the picture of: placed once its mesh is read, before anything else."""

from __future__ import annotations

from dataclasses import replace

from illumcli.film.view import View
from illumcli.rays.camera import Placement
from illumcli.render_graph.build import Graph
from illumcli.render_graph.execute import Run
from illumcli.render_graph.known import with_known


def place_cameras(graph: Graph, run: Run, only_cached: bool = False) -> Graph:
    """The graph with all cameras of its views in place.

    With `only_cached` no mesh is read: a camera whose place is not cached stays where the scene says.
    """
    views = []
    for view in graph.views:
        if view.camera.fit is not None:
            graph = with_known(graph, f"camera:{view.name}", run, only_cached)
            place = graph.known.get(f"camera:{view.name}")
            view = view if place is None else placed(view, place.value)
        views.append(view)
    return replace(graph, views=tuple(views))


def placed(view: View, place: Placement) -> View:
    """The view with its camera at a place."""
    position, target, extent = place
    more = {} if extent is None else {"extent": extent}
    return replace(
        view,
        camera=view.camera.model_copy(update={"position": position, "target": target, "fit": None, **more}),
    )
