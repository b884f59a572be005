"""Nodes of adaptive sampling: they decide which pixels of each layer need all samples.

Pixels first get one sample at their centre. The decision must not be random, so it is based on light without
obscurance: buffers that depend on traced obscurance have copies with w = 1.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial

from illumcli.film.adaptive import centres, detailed, edges, minified, probe_view, probes, refined
from illumcli.film.view import rays, samples
from illumcli.graph import Node, topological_order
from illumcli.layers import FIXED, PER_LIGHT, Layer
from illumcli.render_graph import needs, stages
from illumcli.scene.spec import DIFFERENCE, Scene
from illumcli.visibility.obscurance import baked_or_open

OPEN = "open."
"""Prefix of the names of buffers that are computed with w = 1 in place of traced obscurance."""
REFINED = "refined:"
"""Prefix of the names of buffers that say which pixels of a layer are refined."""
FITTED = "fitted_obscurance"
"""The buffer of reconstructed w, by pixel and object."""
MIXED = ("obscurance", "ambient", "beauty")
"""Buffers of layers that may depend on obscurance."""


def adaptive_nodes(scene: Scene, nodes: Mapping[str, Node], given: Iterable[str]) -> dict[str, Node]:
    """The nodes that decide about each layer's pixels, by buffer; none if no view is adaptive."""
    if all(view.adaptive is None for view in needs.views(scene)):
        return {}
    settings = scene.film.adaptive
    difference = settings.difference if settings else DIFFERENCE
    purposes = [each for each in ("lobes", "ambient", "emission") if needs.may_vary(scene, each)]
    textures = {f"{purpose}_textures": f"{purpose}_textures" for purpose in purposes}
    decisions = [
        Node.of(probe_view),
        Node.of(partial(samples, scene.seed), "probe_samples", view="probe_view"),
        Node.of(partial(rays, scene.film.filter), "probe_rays", view="probe_view", samples="probe_samples"),
        Node.of(probes),
        Node.of(centres),
        Node.of(edges),
        Node("texels", stages.texels, {"geometry": "geometry", "uvs": "uvs", "hits": "hits",
             "material_id": "material_id", **textures}),
        Node.of(minified),
        Node.of(detailed),
    ]  # fmt: skip
    opened = _opened(nodes, given)
    for layer in means(scene):
        values = f"{OPEN}{layer.buffer}" if f"{OPEN}{layer.buffer}" in opened else layer.buffer
        details = "detailed" if textures and layer.kind == "light" else "edges"
        bound = partial(refined, difference)
        decisions.append(Node.of(bound, decision(layer), detailed=details, values=values))
    return opened | {node.output: node for node in decisions}


def means(scene: Scene) -> list[Layer]:
    """The layers of a scene that are means over pixels."""
    of_lights = [row.of(light) for row in PER_LIGHT.values() for light in scene.named_lights()]
    return [layer for layer in [*FIXED.values(), *of_lights] if not layer.data]


def decision(layer: Layer) -> str:
    """Name of the buffer that says which pixels of a layer need all samples."""
    return f"{REFINED}{layer.name}"


def _opened(nodes: Mapping[str, Node], given: Iterable[str]) -> dict[str, Node]:
    """Copies of the nodes that depend on traced obscurance, with w = 1."""
    copies: dict[str, Node] = {}
    for node in topological_order(nodes, [name for name in MIXED if name in nodes], given):
        name = f"{OPEN}{node.output}"
        if node.output == "obscurance" and not {"obscurance_draws", FITTED}.isdisjoint(node.inputs.values()):
            baked = "baked_obscurance" in node.inputs.values()
            copies[name] = Node.of(baked_or_open if baked else stages.alpha, name)
        elif any(f"{OPEN}{need}" in copies for need in node.inputs.values()):
            inputs = {
                parameter: f"{OPEN}{need}" if f"{OPEN}{need}" in copies else need
                for parameter, need in node.inputs.items()
            }
            copies[name] = Node(name, node.function, inputs)
    return copies
