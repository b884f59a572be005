"""Warns where a scene is so much larger than one of its objects that ray offsets become visible around it.

Rays are traced in single precision in render space, and secondary rays start off their surface by a fraction
of their position and of the polygon's edge there (`rays.offsets`). On a floor 10^5 times as large as an
object the offset is some hundredths of the object, and its shadow no longer meets it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from illumcli.film.view import View
from illumcli.geometry.bounds import ObjectBounds
from illumcli.rays.offsets import ORIGIN_OFFSET
from illumcli.records import Value
from illumcli.render_graph.build import Graph
from illumcli.scene.scene_file import SceneFile, message_at
from illumcli.visibility.culling import Boxes, frustum, outside_frustum

VISIBLE = 0.005
"""Share of an object's radius that an offset is seen from: about two pixels where it fills a picture."""
SMALLEST = 0.05
"""Share of the picture's height that an object reaches to be looked at so closely."""


class Disproportion(Value):
    """An object beside which rays start too far off, and what makes the scene so large."""

    small: int
    large: int
    ratio: float
    """How many times as far as the one is large the other reaches."""
    offset: float
    """How far off rays start there [scene units]."""
    share: float
    """Of the small object's radius."""


def disproportion(object_bounds: ObjectBounds, views: Sequence[View]) -> Disproportion | None:
    """The object for which it is worst; None where all is well."""
    size = (object_bounds.high - object_bounds.low) / 2
    centre = object_bounds.low + size
    radius = np.linalg.norm(size, axis=1)
    known = np.flatnonzero(np.isfinite(radius) & (radius > 0))
    found: list[Disproportion] = []
    for i in known[_looked_at(object_bounds, views)[known]]:
        apart = np.abs(centre - centre[i]) - size
        near = known[(apart[known] <= size[i] + radius[i]).all(axis=1)]
        place = float(np.linalg.norm(centre[i] - object_bounds.render_space.centre))
        offset = ORIGIN_OFFSET * (place + float(_edges(radius, object_bounds.polygons)[near].max()))
        if offset > VISIBLE * radius[i]:
            reach = np.linalg.norm(centre - centre[i], axis=1) + radius
            large = int(known[np.argmax(reach[known])])
            ratio, share = float(reach[large] / radius[i]), offset / float(radius[i])
            found.append(Disproportion(int(i), large, ratio, offset, share))
    return max(found, key=lambda each: each.share, default=None)


def disproportion_lines(loaded: SceneFile, graph: Graph, object_bounds: ObjectBounds | None) -> list[str]:
    """A line where rays that leave surfaces start visibly far off those around some object."""
    worst = None if object_bounds is None else disproportion(object_bounds, graph.views)
    if worst is None:
        return []
    small, ratio = graph.scene.object_names()[worst.small], float(f"{worst.ratio:.1g}")
    fact = (
        f"reaches {ratio:,.0f} times as far as {small} is large: around {small}, rays start up to "
        f"{worst.offset:.1g} off surfaces, {100 * worst.share:,.1f} % of its radius, and shadows lose touch; "
        "make it smaller, or bring it nearer"
    )
    return [message_at(loaded, ("objects", worst.large), fact)]


def _edges(radius: NDArray[np.float64], polygons: NDArray[np.int64]) -> NDArray[np.float64]:
    """(O,) about how long an object's longest edges are: as it is itself, unless it has many polygons."""
    return 2 * radius * np.minimum(1, 4 / np.sqrt(np.maximum(polygons, 1)))


def _looked_at(object_bounds: ObjectBounds, views: Sequence[View]) -> NDArray[np.bool_]:
    """(O,) Is the object in some view, and not small there?"""
    render_space = object_bounds.render_space
    with np.errstate(invalid="ignore"):
        low, high = (
            (corner - render_space.centre) / render_space.radius
            for corner in (object_bounds.low, object_bounds.high)
        )
        centre, radius = (low + high) / 2, np.linalg.norm(high - low, axis=1) / 2
        seen = np.zeros(len(low), np.bool_)
        for view in views:
            planes = frustum(view.camera, render_space, view.width, view.height, None)
            if view.camera.projection == "perspective":
                distance = np.linalg.norm(centre - render_space.from_world(view.camera.position), axis=1)
                half = distance * np.tan(np.radians(view.camera.fov) / 2)
            else:
                half = np.full(len(low), view.camera.extent / 2 / render_space.radius)
            seen |= ~outside_frustum(planes, Boxes(low, high)) & (radius >= SMALLEST * half)
    return seen
