"""Cameras that an object is to fill the picture of: placed once its mesh is read, before anything else."""

from __future__ import annotations

from dataclasses import replace

from illumcli.film.view import View
from illumcli.render_graph.cached import Artifacts
from illumcli.render_graph.culling import asked
from illumcli.render_graph.execute import RenderStats
from illumcli.render_graph.schedule import Plan
from illumcli.render_graph.stages import Placement


def framed(
    made: Plan, artifacts: Artifacts, tally: RenderStats, threads: int = 1, at_hand: bool = False
) -> Plan:
    """The plan with its cameras in place.

    With `at_hand` no mesh is read: a camera that the store does not know stays where the scene says.
    """

    def known(view: View) -> View:
        if view.camera.fit is None:
            return view
        place = asked(made, f"camera:{view.name}", artifacts, tally, threads, at_hand)
        return view if place is None else placed(view, place)

    return replace(made, views=tuple(known(view) for view in made.views))


def placed(view: View, place: Placement) -> View:
    """The view with its camera at a place."""
    position, target, extent = place
    more = {} if extent is None else {"extent": extent}
    return replace(view, camera=view.camera.replaced(position=position, target=target, fit=None, **more))
