"""Costs of pictures, from scenes alone: in what proportion they take time, the same on every machine.

The unit is an obscurance ray, 0.12 us of one core when this was measured (2026, teapot at 960 x 540, 4
samples per pixel). Proportions hold within a factor of two or so, which is enough for shards.
"""

from __future__ import annotations

from collections.abc import Sequence

from illumcli import __version__
from illumcli.film.view import View
from illumcli.layers import Layer
from illumcli.records import Value
from illumcli.render_graph.build import Graph
from illumcli.render_graph.explain import expected_rays
from illumcli.render_graph.keys import Keys
from illumcli.render_graph.replicates import REPLICATE
from illumcli.render_graph.schedule import reached

CAMERA_RAY = 10
"""Of a camera ray with the interaction and the interpolation at its hit."""
BYTES = 9
"""So many bytes of expected memory cost one ray to read a mesh, and to build its tree."""
PICTURE = 100_000
"""Of a picture, however small: planning, opening and closing files."""


class Cost(Value):
    """What a unit of work costs [obscurance rays]."""

    alone: int
    after: int
    """Right after the unit before it, whose buffers it shares."""


class CostModel:
    """Costs of one unit after the other; it remembers the keys of the unit before."""

    def __init__(self) -> None:
        self._before: dict[tuple[str, str], str] = {}

    def of(self, graph: Graph, outputs: Sequence[Layer], views: Sequence[View], mesh_bytes: int) -> Cost:
        """The cost of some views of a scene whose meshes take `mesh_bytes` of memory.

        A buffer whose key is that of the unit before costs nothing after it.
        """
        names, now = reached(graph, outputs), dict[tuple[str, str], str]()
        alone = after = 0
        for view in views:
            keys = Keys(graph.nodes, view, __version__)
            now |= {(view.name, name): keys(name) for name in {*names, "geometry"} & graph.nodes.keys()}
            samples = view.width * view.height * view.samples * view.stands_for
            alone, after = alone + PICTURE + samples, after + PICTURE + samples
            for purpose, count in expected_rays(graph.scene, (view,), set(names)).items():
                cost = count * (CAMERA_RAY if purpose.endswith("primary") else 1)
                place = view.name, purpose.replace("primary", "hits").removeprefix(REPLICATE)
                alone += cost
                after += 0 if place in now and now[place] == self._before.get(place) else cost
        of_meshes = mesh_bytes // BYTES
        places = [(view.name, "geometry") for view in views]
        shares = all(now.get(place) in self._before.values() for place in places)
        self._before = now
        return Cost(alone + of_meshes, after if shares else after + of_meshes)
