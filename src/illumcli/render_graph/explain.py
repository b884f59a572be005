"""Explains a plan: why buffers are not computed, and upper bounds of its rays and memory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from illumcli.cache.codec import codec_of
from illumcli.film.view import View
from illumcli.layers import Layer
from illumcli.rays.ray_loop import ray_loop_name
from illumcli.render_graph import needs
from illumcli.render_graph.build import Graph
from illumcli.render_graph.build_adaptive import FITTED, OPEN, REFINED
from illumcli.render_graph.culling import why_all
from illumcli.render_graph.replicates import REPLICATE, replicated_count
from illumcli.render_graph.schedule import Plan, error_is_audited, reached
from illumcli.render_graph.tile_nodes import LARGEST_FIT
from illumcli.scene.spec import Scene

CULLED = "outside every view; casts no shadow or obscurance onto anything visible"
CACHED = "everything that needs it is cached"


def why_not(graph: Graph, outputs: Sequence[Layer], plan: Plan | None = None) -> dict[str, str]:
    """The reason for every buffer that is not computed and every object that is culled.

    Parameters
    ----------
    plan : Plan, optional
        The plan of one view, in which cached buffers are loaded.
    """
    # Buffers that no output needs; cameras are placed, and bounds computed, before the graph is scheduled.
    order = reached(graph, outputs)
    computed = set(order)
    reasons = {}
    for name in graph.nodes:
        if name in computed or name.startswith((REPLICATE, OPEN, REFINED, "camera:")):
            continue
        if graph.culled and name in ("implied_widths", "every_mesh"):
            continue
        reasons[name] = graph.why_not(name)
    if "error" in computed and f"{REPLICATE}samples" not in computed:
        reasons[f"{REPLICATE}beauty"] = "nothing in the image is random: its error is 0"

    # Culled objects, and buffers that only cached ones need.
    names = graph.scene.object_names()
    reasons |= {f"object:{names[number]}": CULLED for number in graph.culled}
    if plan is not None:
        taken = plan.buffers | graph.known.keys()
        skipped = (name for name in order if name not in taken)
        reasons |= dict.fromkeys(skipped, CACHED)
    return reasons


def obscurance_files(graph: Graph, outputs: Sequence[Layer]) -> dict[str, str]:
    """The files that obscurance is read from, by object, if an output needs it."""
    return needs.files_of_obscurance(graph.scene) if "obscurance" in reached(graph, outputs) else {}


def which_objects(graph: Graph, outputs: Sequence[Layer]) -> str:
    """Which objects are rendered, and why."""
    why = why_all(graph, outputs)
    if why is not None:
        return f"all: {why}"
    if graph.culled:
        return f"all but {len(graph.culled)}, which are culled"
    return "all, unless their bounds allow culling once the meshes are read"


def expected_rays(scene: Scene, views: Sequence[View], computed: set[str]) -> dict[str, int]:
    """Upper bounds of the rays of some views, by purpose, if these buffers are computed.

    As if every pixel of an adaptive view needed all samples; the borders of its tiles are not counted.
    """
    samples = full = probes = replicated = 0
    for view in views:
        pixels, count = view.width * view.height, view.samples * view.stands_for
        full += pixels * count
        replicated += replicated_count(view.width, view.height) * count
        if view.adaptive is None:
            samples += pixels * count
        else:
            refines = any(name.startswith(REFINED) for name in computed)
            samples += pixels * (1 + count) if refines else pixels
            probes += pixels * view.adaptive.probes
    rays = _rays_of(scene, samples, full, computed) | ({"probes": probes} if "probes" in computed else {})

    of_replicates = {name.removeprefix(REPLICATE) for name in computed if name.startswith(REPLICATE)}
    more = _rays_of(scene, replicated, replicated, of_replicates)
    return rays | {f"{REPLICATE}{name}": count for name, count in more.items()}


def _rays_of(scene: Scene, samples: int, full: int, computed: set[str]) -> dict[str, int]:
    """Upper bounds of the rays of this many samples, by purpose; `full` of them cast obscurance rays."""
    rays = {"primary": samples} if "hits" in computed else {}
    for name, light in scene.named_lights().items():
        if f"shadow:{name}" in computed and light.shadows and any(light.color()):
            rays[f"shadow:{name}"] = samples
    if {"obscurance", "obscurance_draws"} <= computed and scene.obscurance:
        traced = "raw_obscurance" if "raw_obscurance" in computed else "obscurance"
        rays[traced] = full * scene.obscurance.samples
    return rays


def expected_bytes(plan: Plan) -> dict[str, int]:
    """Upper bounds of the memory of a plan beside its meshes: a band of tiles, and each buffer that is read
    from or may be written to the cache; the system may drop the pages of the latter."""
    view = plan.view
    is_held = error_is_audited(plan.graph.scene, plan.outputs)  # until the audit makes that layer
    rows = view.height if is_held else min(view.height, plan.tile_side(view))
    samples = rows * view.width * view.samples
    sizes = {"band": samples * 4 * sum(len(layer.channels) for layer in plan.outputs) // view.samples}
    for name in [*plan.lookup.keeps, *plan.lookup.reused]:
        if name == FITTED:  # column, row, object and value of about one pair of each pixel
            sizes[name] = 16 * min(view.width * view.height, LARGEST_FIT)
        if codec := codec_of(name):
            shape, dtype = codec.layout(view)
            sizes[name] = math.prod(shape) * np.dtype(dtype).itemsize
    return sizes


def plan_data(plan: Plan, expected: Mapping[str, int]) -> dict[str, Any]:
    """A plan for JSON output; `expected` is the memory of shapes, mesh files and textures [bytes]."""
    view, graph = plan.view, plan.graph
    count = view.samples * view.stands_for
    size = {"camera": view.name, "width": view.width, "height": view.height, "samples": count}
    probes = {"probes": view.adaptive.probes} if view.adaptive else {}
    whole = graph.without_loaders()
    rays = expected_rays(graph.scene, (view,), plan.computed)
    return {
        "views": [size | probes],
        "layers": [layer.name for layer in plan.outputs],
        "objects": which_objects(whole, plan.outputs),
        "once": [node.output for node in plan.once],
        "tile": [node.output for node in plan.tile],
        "obscurance_files": obscurance_files(whole, plan.outputs),
        "skipped": why_not(whole, plan.outputs, plan),
        "expected_rays": rays,
        "ray_loop": ray_loop_name() if rays else None,
        "reused": dict(plan.lookup.reused),
        "expected_bytes": {**expected, **expected_bytes(plan)},
    }
