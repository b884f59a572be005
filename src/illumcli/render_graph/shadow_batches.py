"""Shadows of many lights: those of some consecutive lights are computed together in a tile.

Most samples are decided by a first ray for each light. The few that remain of one light take as long as many
would, so they are traced for all lights of a batch at once. Buffers and their keys are those of single
lights, as are the bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from illumcli.graph import Node
from illumcli.render_graph.schedule import Plan
from illumcli.visibility.shadows import shadow, shadow_of, shadows

BATCH = 8
"""Lights of a batch, at most; their incident light is held meanwhile. A scene of fewer has no batch."""
CANDIDATES = "shadow_candidates"


def with_shadow_batches(plan: Plan) -> Plan:
    """The plan for one pass over the tiles, with batches; itself where tiles run in several passes."""
    if plan.before or plan.all_samples is not None:
        return plan
    return replace(plan, tile=tuple(batched(plan.tile)))


def batched(nodes: Sequence[Node]) -> list[Node]:
    """The nodes of a tile, in which shadows of consecutive lights are of one node."""
    of_shadow = [node for node in nodes if node.function is shadow and "smooth_surface" in node.inputs]
    if len(of_shadow) < BATCH:
        return list(nodes)
    by_name = {node.output: node for node in nodes}
    batches = (of_shadow[first : first + BATCH] for first in range(0, len(of_shadow), BATCH))
    batch_of = {batch[0].output: batch for batch in batches if len(batch) > 1}
    out: list[Node] = []
    known: set[str] = set()
    for node in nodes:
        if node.output in known:
            continue
        # A batch stands where its first light's shadow does, behind the incident light of all its lights.
        together = [node]
        if batch := batch_of.get(node.output):
            lights = [each.inputs[CANDIDATES] for each in batch]
            incident = [by_name[name] for name in lights if name in by_name and name not in known]
            reads = {name for each in (*batch, *incident) for name in each.inputs.values()}.difference(lights)
            if all(name in known or name not in by_name for name in reads):
                together = [*incident, *_together(batch, f"shadows until {batch[-1].output}")]
        out += together
        known |= {each.output for each in together}
    return out


def _together(batch: Sequence[Node], name: str) -> list[Node]:
    """A node that computes all shadows of a batch, and one for each light that hands its shadow on."""
    candidates = [node.inputs[CANDIDATES] for node in batch]
    common = {need: buffer for need, buffer in batch[0].inputs.items() if need != CANDIDATES}
    all_shadows = Node(name, shadows, {**common, **dict(zip(candidates, candidates, strict=True))})
    each = [
        replace(node, function=partial(shadow_of, candidate), inputs={"shadows": name})
        for node, candidate in zip(batch, candidates, strict=True)
    ]
    return [all_shadows, *each]
