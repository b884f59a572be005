"""Costs of units of work, by which they are shared out."""

from __future__ import annotations

from illumcli.commands.work import Work
from illumcli.render_graph.costs import Cost, CostModel
from illumcli.render_graph.limits import expected_memory


def cost_of(work: Work, model: CostModel) -> Cost:
    """The cost of rendering the pictures of a work, and what they add to those of the work before."""
    rendered = {target.view.name for target in work.targets}
    views = [view for view in work.graph.views if view.name in rendered]
    meshes = expected_memory(work.loaded, work.scene).get("meshes", 0)
    return model.of(work.graph, work.outputs, views, meshes)
