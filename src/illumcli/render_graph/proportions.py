"""Warns if a scene is so much larger than one of its objects that ray offsets become visible around it.

Rays are traced in single precision in render space. Secondary rays start above their surface by an offset
that is proportional to their position and to the polygon's edge (`rays.offsets`). On a floor 10^5 times as
large as an object, the offset is some hundredths of the object, and a gap shows between the object and its
shadow.
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
"""Share of an object's radius above which an offset is visible: about two pixels if it fills the image."""
SMALLEST = 0.05
"""Share of the image's height below which an object is too small for its offset to be visible."""


class Disproportion(Value):
    """An object around which ray offsets are visible, and the object that makes the scene so large."""

    small: int  # number of the first
    large: int  # number of the second
    ratio: float
    """Greatest distance of the large object from the small one, in radii of the latter."""
    offset: float
    """Ray offset around the small object [scene units]."""
    share: float
    """The offset in radii of the small object."""


def disproportion(object_bounds: ObjectBounds, views: Sequence[View]) -> Disproportion | None:
    """The object with the largest visible offset; None if no offset is visible."""
    size = (object_bounds.high - object_bounds.low) / 2
    centre = object_bounds.low + size
    radius = np.linalg.norm(size, axis=1)
    known = np.flatnonzero(np.isfinite(radius) & (radius > 0))
    visible: list[Disproportion] = []
    for i in known[_is_visible(object_bounds, views)[known]]:
        # The offset on the object and on those near it, which its shadow may fall on.
        apart = np.abs(centre - centre[i]) - size
        near = known[(apart[known] <= size[i] + radius[i]).all(axis=1)]
        from_centre = float(np.linalg.norm(centre[i] - object_bounds.render_space.centre))
        offset = ORIGIN_OFFSET * (from_centre + float(_edges(radius, object_bounds.polygons)[near].max()))

        # If it is visible, the object that reaches farthest is to blame.
        if offset > VISIBLE * radius[i]:
            reach = np.linalg.norm(centre - centre[i], axis=1) + radius
            large = int(known[np.argmax(reach[known])])
            ratio, share = float(reach[large] / radius[i]), offset / float(radius[i])
            visible.append(Disproportion(int(i), large, ratio, offset, share))
    return max(visible, key=lambda each: each.share, default=None)


def disproportion_lines(loaded: SceneFile, graph: Graph, object_bounds: ObjectBounds | None) -> list[str]:
    """A warning if ray offsets are visible around some object."""
    worst = None if object_bounds is None else disproportion(object_bounds, graph.views)
    if worst is None:
        return []
    small, ratio = graph.scene.object_names()[worst.small], float(f"{worst.ratio:.1g}")
    fact = (
        f"reaches {ratio:,.0f} times as far as {small} is large: around {small}, rays start up to "
        f"{worst.offset:.1g} off surfaces, {100 * worst.share:,.1f} % of its radius, and shadows lose "
        "contact; make it smaller, or bring it nearer"
    )
    return [message_at(loaded, ("objects", worst.large), fact)]


def _edges(radius: NDArray[np.float64], polygons: NDArray[np.int64]) -> NDArray[np.float64]:
    """(O,) estimated longest edge of each object: its diameter, less if it has many polygons."""
    return 2 * radius * np.minimum(1, 4 / np.sqrt(np.maximum(polygons, 1)))


def _is_visible(object_bounds: ObjectBounds, views: Sequence[View]) -> NDArray[np.bool_]:
    """(O,) True for objects that are in some view and not small there."""
    # Boxes and bounding spheres in render space.
    render_space = object_bounds.render_space
    with np.errstate(invalid="ignore"):
        low, high = (
            (corner - render_space.centre) / render_space.radius
            for corner in (object_bounds.low, object_bounds.high)
        )
        centre, radius = (low + high) / 2, np.linalg.norm(high - low, axis=1) / 2

        # Compare each sphere with half the height of the view at its distance.
        visible = np.zeros(len(low), np.bool_)
        for view in views:
            planes = frustum(view.camera, render_space, view.width, view.height, None)
            if view.camera.projection == "perspective":
                distance = np.linalg.norm(centre - render_space.from_world(view.camera.position), axis=1)
                half = distance * np.tan(np.radians(view.camera.fov) / 2)
            else:
                half = np.full(len(low), view.camera.extent / 2 / render_space.radius)
            visible |= ~outside_frustum(planes, Boxes(low, high)) & (radius >= SMALLEST * half)
    return visible
