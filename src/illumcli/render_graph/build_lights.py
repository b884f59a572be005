"""Nodes of lights: incident light, shadow and response of each, and the sums over all lights."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

from illumcli.geometry.smooth_parts import SmoothParts
from illumcli.graph import Node
from illumcli.lights import _incident as incident
from illumcli.lights._base import Light
from illumcli.render_graph import needs, stages
from illumcli.scene.spec import Scene
from illumcli.shading.ambient import ambient, coupled
from illumcli.shading.direct import add, black, direct, irradiance, one_lobe, sum_lobes
from illumcli.shading.rates import RATES
from illumcli.visibility.shadows import shadow, smooth_surface

BLOCK = 16
"""Terms of a sum that one node adds."""
DEEPEST = 64
"""Most blocks of a sum, each of which reads the one before it; with more terms blocks are larger."""


def light_nodes(scene: Scene) -> list[Node]:
    """The nodes of each light; a light of intensity 0 has neither rays nor response."""
    # The smooth surface that normals imply and shadow rays may start from, unless every object is flat.
    smooth = needs.is_smooth(scene)
    flat = tuple(not RATES[rate].is_smooth for rate in needs.rates(scene))
    nodes = [
        Node.of(SmoothParts, "smooth_parts", normals="corner_normals"),
        Node.of(partial(smooth_surface, flat), "smooth_surface"),
    ] if smooth else []  # fmt: skip
    nodes.append(Node.of(stages.ray_order))
    implied = {"smooth_surface": "smooth_surface"} if smooth and scene.terminator == "smooth" else {}

    eye: dict[str, str] = {term: term for term in ("v", "t") if term in needs.needed_terms(scene)}
    at_samples = all(RATES[rate].at_samples for rate in needs.rates(scene))
    for name, light in scene.named_lights().items():
        if not needs.is_on(light):
            nodes += [Node.of(black, f"light:{name}"), Node.of(stages.no_shadow, f"shadow:{name}")]
            continue
        nodes += _shadow_nodes(name, light, at_samples, implied)
        nodes += _response_nodes(name, light, at_samples, eye)
    return nodes


def shortcuts(scene: Scene) -> dict[str, Node]:
    """Nodes that know the lit points of a light from its shadow, without the light at the other points."""
    nodes = [
        Node.of(
            partial(incident.unshadowed_by_shadow, light.without_color()),
            f"unshadowed:{name}",
            shadow=f"shadow:{name}",
        )
        for name, light in scene.named_lights().items()
    ]
    return {node.output: node for node in nodes}


def _shadow_nodes(name: str, light: Light, at_samples: bool, implied: Mapping[str, str]) -> list[Node]:
    """Nodes of a light's unoccluded incident light and of its shadow.

    `implied` names the smooth surface that shadow rays may start from, if there is one.
    """
    colorless = light.without_color()
    order = {"ray_order": "ray_order"} if light.shadows else {}
    order_of_incident = order if at_samples else {}
    nodes = [Node.of(partial(incident.incident, colorless), f"incident:{name}", **order_of_incident)]
    if not light.shadows:
        nodes.append(Node.of(stages.no_shadow, f"shadow:{name}"))
    if at_samples:  # the samples that need shadow rays are the points where models are evaluated
        candidates = f"incident:{name}"
    else:
        candidates = f"shadow_candidates:{name}"
        nodes.append(Node.of(partial(incident.shadow_candidates, colorless), candidates, **order))
    if light.shadows:
        nodes.append(Node.of(shadow, f"shadow:{name}", shadow_candidates=candidates, **implied))
        if at_samples:  # models are not evaluated in shadow
            lit = {"incident": f"incident:{name}", "shadow": f"shadow:{name}"}
            nodes.append(Node.of(incident.unshadowed, f"unshadowed:{name}", **lit))
    return nodes


def _response_nodes(name: str, light: Light, at_samples: bool, eye: Mapping[str, str]) -> list[Node]:
    """Nodes of the response to one light: lobe by lobe, their sum, and the irradiance; all shadowed."""
    color = light.color()
    before = light.shadows and at_samples  # shadows are known before models are evaluated
    lit = f"unshadowed:{name}" if before else f"incident:{name}"
    after = {"shadow": f"shadow:{name}"} if light.shadows and not at_samples else {}
    lobes = f"direct:{name}"
    return [
        Node.of(partial(direct, color), lobes, materials="lobes_materials", incident=lit, **eye),
        Node.of(sum_lobes, f"light:{name}", direct=lobes, **after),
        Node.of(partial(one_lobe, "diffuse"), f"diffuse:{name}", direct=lobes, **after),
        Node.of(partial(one_lobe, "specular"), f"specular:{name}", direct=lobes, **after),
        Node.of(partial(irradiance, color), f"irradiance:{name}", incident=lit, **after),
    ]


def sum_nodes(scene: Scene) -> list[Node]:
    """Nodes of the sums over lights, and of the beauty."""
    lights = list(needs.active_lights(scene))
    obscured = {"obscurance": "obscurance"} if needs.weighs_ambient(scene) else {}
    nodes = [
        Node.of(partial(ambient, scene.ambient.color), "ambient", **obscured),
        *_sum("direct", [f"light:{name}" for name in lights]),
        *_sum("irradiance", [f"irradiance:{name}" for name in lights]),
        *_sum("diffuse", [f"diffuse:{name}" for name in lights]),
        *_sum("specular", [f"specular:{name}" for name in lights]),
    ]

    # The beauty: emission, ambient light and all lights, in this order; then the depth cue.
    parts = ["emission"] if needs.is_emissive(scene) else []
    if scene.ambient.form == "coupled":
        nodes.append(Node.of(partial(coupled, scene.ambient.color), "coupled", **obscured))
        parts.append("coupled")
    else:
        parts += ["ambient"] if needs.is_ambient(scene) else []
        parts += [f"light:{name}" for name in lights]
    if scene.depth_cue is None:
        return [*nodes, *_sum("beauty", parts)]
    return [*nodes, *_sum("uncued", parts), Node.of(partial(stages.depth_cued, scene.depth_cue), "beauty")]


def _sum(output: str, parts: list[str]) -> list[Node]:
    """Nodes of the sum of some buffers in their order, a block at a time.

    A node adds a block to the sum before it. So with many lights only one block of their buffers is held.
    """
    size = max(BLOCK, -(-len(parts) // DEEPEST))
    nodes: list[Node] = []
    for first in range(0, max(len(parts), 1), size):
        before = [node.output for node in nodes[-1:]]
        end = first + size
        name = output if end >= len(parts) else f"{output} of {end}"
        terms = {part: part for part in [*before, *parts[first:end]]}
        nodes.append(Node(name, add, {"hits": "hits", **terms}))
    return nodes
