"""Objects that no view can tell the presence of are left out: neither cut into triangles nor traced.

Only boxes tell, which are known once the meshes are read; the frame stays that of all objects.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from illumcli.geometry.bounds import ObjectBounds
from illumcli.graph import topological_order
from illumcli.render_graph.build import SMOOTH, active_lights, rates
from illumcli.render_graph.cached import Artifacts, Book
from illumcli.render_graph.execute import RenderStats, run_once
from illumcli.render_graph.schedule import GIVEN, Plan, plan
from illumcli.scene.spec import Obscurance
from illumcli.visibility.culling import Boxes, SecondaryRays, culled_objects, frustum

WHY = "no view sees it, and it shadows and obscures nothing that one sees"


def why_all(made: Plan) -> str | None:
    """Why every object is needed, as far as the scene alone tells; None where boxes may tell more."""
    scene = made.scene
    if scene is None or len(scene.objects) < 2:
        return "there is one object at most"
    if any(layer.buffer == "triangle_id" for layer in made.layers):
        return "triangle_id numbers the triangles of all objects"
    if _reach(made, 1.0) == np.inf:
        return "obscurance rays reach any distance"
    return None


def _reach(made: Plan, radius: float) -> float:
    """How far obscurance rays of the plan tell anything [scene units]; 0 where it casts none."""
    steps = {step.output for step in made.tile}
    if made.scene is None or not {"obscurance", "obscurance_draws"} <= steps:
        return 0.0
    return (made.scene.obscurance or Obscurance()).falloff.reach(radius)


def unseen_objects(
    made: Plan, artifacts: Artifacts, tally: RenderStats, threads: int = 1, at_hand: bool = False
) -> tuple[int, ...]:
    """The numbers of the objects that can be left out of all views of a plan.

    What is made to know it is counted in `tally`, and at hand in `artifacts` from then on. With `at_hand`
    nothing is made: where the store does not know the boxes, or where a camera stands, nothing is left out.
    """
    scene = made.scene
    if scene is None or why_all(made) is not None or any(view.camera.fit for view in made.views):
        return ()
    object_bounds: ObjectBounds | None = asked(made, "object_bounds", artifacts, tally, threads, at_hand)
    if object_bounds is None:
        return ()
    render_space, film = object_bounds.render_space, scene.film
    boxes = Boxes(
        *(
            (corner - render_space.centre) / render_space.radius
            for corner in (object_bounds.low, object_bounds.high)
        )
    )
    views = [
        frustum(view.camera, render_space, view.width, view.height, film.filter if view.samples > 1 else None)
        for view in made.views
    ]
    steps = {step.output for step in made.tile}
    lights = [
        light for name, light in active_lights(scene).items() if light.shadows and f"shadow:{name}" in steps
    ]
    rays = SecondaryRays(lights, _reach(made, render_space.radius) / render_space.radius)
    found = culled_objects(boxes, np.zeros(len(boxes.low)), views, rays, render_space)
    if found.any() and lights and scene.terminator == "smooth" and set(rates(scene)) & set(SMOOTH):
        widths = asked(made, "implied_widths", artifacts, tally, threads, at_hand)
        if widths is None:
            return ()
        found = culled_objects(boxes, widths / render_space.radius, views, rays, render_space)
    if found.any():
        tally.add({}, {}, {"polygons": int(object_bounds.polygons[found].sum())})
    return tuple(int(number) for number in np.flatnonzero(found))


def without(made: Plan, loaded: Any, numbers: tuple[int, ...]) -> Plan:
    """The plan with these objects left out."""
    if made.scene is None or not numbers:
        return made
    fewer = plan(made.scene, loaded, [layer.name for layer in made.layers], numbers)
    names = made.scene.object_names()
    skipped = {name: why for name, why in fewer.skipped.items() if name != "implied_widths"}
    skipped |= {f"object:{names[number]}": WHY for number in numbers}
    return replace(fewer, views=made.views, skipped=skipped)


def asked(
    made: Plan, name: str, artifacts: Artifacts, tally: RenderStats, threads: int, at_hand: bool
) -> Any:
    """A buffer of the whole scene, before the plan runs; None where it would have to be made and must not."""
    book = Book(made.book, made.views[0], artifacts)
    steps = topological_order(book, [name], GIVEN)
    if at_hand and name not in artifacts.reused:
        return None
    new = [
        step.output
        for step in steps
        if step.output not in artifacts.reused and book.keys_of(step.output) not in artifacts.made
    ]
    kept = {each: book.keys_of(each) for each in new if artifacts.keeps(each)}
    first = replace(made, once=tuple(steps), reused=artifacts.reused, keeps=kept)
    buffers = run_once(first, tally, artifacts, threads)
    artifacts.made.update((book.keys_of(each), value) for each, value in buffers.items())
    return buffers[name]
