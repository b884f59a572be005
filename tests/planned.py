"""Plans of a scene's view and the layers that they compute, for tests."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.cache.recorder import Cache
from illumcli.render_graph.build import build
from illumcli.render_graph.execute import Run, bands, run_once
from illumcli.render_graph.pipeline import plan_view
from illumcli.render_graph.schedule import Plan, outputs_of, schedule
from illumcli.scene.scene_file import SceneFile


def planned(loaded: SceneFile, only: Sequence[str] = (), cache: Cache | None = None, number: int = 0) -> Plan:
    """The plan of one view of a scene; what `cache` holds is loaded."""
    graph, outputs = build(loaded.scene, loaded), outputs_of(loaded.scene, only)
    if cache is None:
        return schedule(graph, outputs, graph.views[number])
    return plan_view(graph, outputs, graph.views[number], cache)


def layers_of(
    plan: Plan,
    run: Run = Run(),  # noqa: B008
    side: int | None = None,
    shared: Mapping[str, Any] | None = None,
) -> dict[str, NDArray[Any]]:
    """Layer -> (H, W, channels) of a plan; `shared` are the buffers of the whole scene, if they are known."""
    shared = run_once(plan, run) if shared is None else shared
    rows = list(bands(plan, shared, run, side=side))
    return {name: np.concatenate([band.layers[name] for band in rows]) for name in rows[0].layers}
