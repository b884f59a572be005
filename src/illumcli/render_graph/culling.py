"""Culling: objects that cannot affect any view are neither triangulated nor traced.

Their bounding boxes decide, which are known once the meshes are read. Render space stays that of all objects.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.geometry.bounds import ObjectBounds
from illumcli.geometry.scene_geometry import without_culled
from illumcli.graph import Node
from illumcli.layers import Layer
from illumcli.records import Record
from illumcli.render_graph.build import Graph
from illumcli.render_graph.execute import Run
from illumcli.render_graph.known import with_known
from illumcli.render_graph.needs import active_lights, is_smooth
from illumcli.render_graph.schedule import reached
from illumcli.scene.spec import Obscurance
from illumcli.visibility.culling import Boxes, SecondaryRays, culled_objects, frustum


class Bounds(Record):
    """The bounding boxes of all objects, and the size of polygons that shadow rays may start above."""

    objects: ObjectBounds
    widths: NDArray[np.float64]
    """(O,) largest polygon diagonal of each object with terminator correction [scene units], else 0."""


def why_all(graph: Graph, outputs: Sequence[Layer]) -> str | None:
    """Why every object is needed, if the scene alone shows this; None if bounding boxes must decide."""
    if len(graph.scene.objects) < 2:
        return "there is one object at most"
    if any(layer.buffer == "triangle_id" for layer in outputs):
        return "triangle_id numbers the triangles of all objects"
    if _obscurance_reach(graph, reached(graph, outputs), 1.0) == np.inf:
        return "obscurance rays reach any distance"
    return None


def find_bounds(
    graph: Graph, outputs: Sequence[Layer], run: Run, only_cached: bool = False
) -> tuple[Graph, Bounds | None]:
    """The bounds of all objects, and the graph in which they are known; None if no object can be culled.

    With `only_cached` nothing is computed: bounds that are not cached are None.
    """
    if why_all(graph, outputs) is not None or any(view.camera.fit for view in graph.views):
        return graph, None
    graph = with_known(graph, "object_bounds", run, only_cached)
    if "object_bounds" not in graph.known:
        return graph, None
    objects = graph.known["object_bounds"].value
    bounds = Bounds(objects, np.zeros(len(objects.low)))

    # The widths are needed only if some box would be culled and shadow rays start from smooth surfaces.
    scene = graph.scene
    shadowed = any(name.startswith("shadow:") for name in reached(graph, outputs))
    smooth = scene.terminator == "smooth" and is_smooth(scene)
    if shadowed and smooth and unaffecting(graph, outputs, bounds):
        graph = with_known(graph, "implied_widths", run, only_cached)
        if "implied_widths" not in graph.known:
            return graph, None
        bounds = Bounds(objects, graph.known["implied_widths"].value)
    return graph, bounds


def unaffecting(graph: Graph, outputs: Sequence[Layer], bounds: Bounds) -> tuple[int, ...]:
    """The numbers of the objects that are outside every view and cast no shadow or obscurance into one."""
    # Boxes and frustums in render space.
    space, film = bounds.objects.render_space, graph.scene.film
    low, high = (
        (corner - space.centre) / space.radius for corner in (bounds.objects.low, bounds.objects.high)
    )
    views = [
        frustum(view.camera, space, view.width, view.height, film.filter if view.samples > 1 else None)
        for view in graph.views
    ]

    # The secondary rays that the outputs need.
    buffers = reached(graph, outputs)
    lights = [
        light
        for name, light in active_lights(graph.scene).items()
        if light.shadows and f"shadow:{name}" in buffers
    ]
    rays = SecondaryRays(lights, _obscurance_reach(graph, buffers, space.radius) / space.radius)
    culled = culled_objects(Boxes(low, high), bounds.widths / space.radius, views, rays, space)
    return tuple(int(number) for number in np.flatnonzero(culled))


def cull(
    graph: Graph, outputs: Sequence[Layer], bounds: Bounds | None, needed: Collection[int] = frozenset()
) -> Graph:
    """The graph without the polygons of objects that cannot affect any view.

    Parameters
    ----------
    needed : collection of int
        Numbers of objects that are kept in any case because an earlier variant needed them: if each variant
        culled other objects, none could reuse the geometry of another.
    """
    if bounds is None:
        return graph
    culled = unaffecting(graph, outputs, bounds)
    return without_objects(graph, tuple(number for number in culled if number not in needed))


def without_objects(graph: Graph, numbers: tuple[int, ...]) -> Graph:
    """The graph without the polygons of the objects of these numbers.

    Their meshes are still read, for bounds and for cameras that fit an object; their baked obscurance is not.
    """
    if not numbers:
        return graph

    # `meshes` loses the polygons; bounds and cameras read `every_mesh` instead.
    nodes = dict(graph.nodes)
    nodes["every_mesh"] = replace(nodes["meshes"], output="every_mesh", kind="meshes")
    nodes["meshes"] = Node.of(partial(without_culled, numbers), "meshes", meshes="every_mesh")
    for name, node in nodes.items():
        if name in ("object_bounds", "implied_widths") or name.startswith("camera:"):
            nodes[name] = replace(node, inputs={**node.inputs, "meshes": "every_mesh"})

    # No baked values of culled objects.
    culled = frozenset(numbers)
    for output in ("baked", "occlusion_maps"):
        if output in nodes:
            bound: Any = nodes[output].function
            files, *others = bound.args
            kept = tuple((name, None if k in culled else file) for k, (name, file) in enumerate(files))
            nodes[output] = replace(nodes[output], function=partial(bound.func, kept, *others))
    known = dict(graph.known)
    if "meshes" in known:
        known["every_mesh"] = known.pop("meshes")
    return replace(graph, nodes=nodes, known=known, culled=numbers)


def _obscurance_reach(graph: Graph, buffers: Collection[str], radius: float) -> float:
    """The length of obscurance rays [scene units]; 0 if none are cast."""
    if not {"obscurance", "obscurance_draws"} <= set(buffers):
        return 0.0
    return (graph.scene.obscurance or Obscurance()).falloff.reach(radius)
