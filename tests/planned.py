"""Plans of a scene's view, for tests."""

from __future__ import annotations

from collections.abc import Sequence

from illumcli.cache.recorder import Cache
from illumcli.render_graph.build import build
from illumcli.render_graph.pipeline import plan_view
from illumcli.render_graph.schedule import Plan, outputs_of, schedule
from illumcli.scene.scene_file import SceneFile


def planned(loaded: SceneFile, only: Sequence[str] = (), cache: Cache | None = None, number: int = 0) -> Plan:
    """The plan of one view of a scene; what `cache` holds is loaded."""
    graph, outputs = build(loaded.scene, loaded), outputs_of(loaded.scene, only)
    if cache is None:
        return schedule(graph, outputs, graph.views[number])
    return plan_view(graph, outputs, graph.views[number], cache)
