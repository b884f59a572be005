"""Culling: objects whose bounding boxes prove that they cannot change any image.

An object is culled only where planes prove it: one between it and every view, and one between it and the hull
of all visible geometry, of that geometry's shadow rays to each light, and of its obscurance rays. Boxes and
hulls are larger than what they hold and the search for planes gives up early, so errors keep objects and
never cull one that matters.

References
----------
Gilbert, E. G. (1966). An iterative procedure for computing the minimum of a quadratic form on a convex set.
SIAM J. Control 4(1): the iteration towards the nearest point, each step of which offers a separating plane.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import column_major
from illumcli.geometry.spatial_order import compact
from illumcli.lights._base import Light
from illumcli.rays.camera import axes, offsets
from illumcli.rays.viewpoints import Camera, PixelFilter
from illumcli.render_space import RenderSpace
from illumcli.visibility.shadows import NEARBY, TERMINATOR_SHARE

BOX_MARGIN = 1e-4
"""Enlargement of boxes and hulls [radii]. Rounding, the retry of rays that miss and the offsets of secondary
rays together move a ray by a tenth of this."""
SHADOW_REACH = 20.0
"""Length at which a shadow ray from any point in or near the scene has left it [radii]."""
MAX_STEPS = 40
PARALLEL = 1e-9
"""Determinant of three unit normals below which their planes count as having no common point."""
PAIRS_AT_ONCE = 1 << 20
"""Pairs of a hull's point and a box that are compared at once."""
LARGE_BOXES, GROUPED_BOXES = 8, 16
"""If there are many boxes, this many of the largest stay as they are, and the others are merged with their
neighbours into this many."""

Positions: TypeAlias = NDArray[np.float64]
"""(N, 3) in radii."""


class Boxes(NamedTuple):
    """K axis-aligned boxes."""

    low: Positions  # (K, 3) lowest corners [radii]
    high: Positions  # (K, 3) highest corners

    def take(self, index: NDArray[Any] | slice) -> Boxes:
        """The boxes of these indices, or where this mask is True."""
        return Boxes(self.low[index], self.high[index])

    def enlarged(self, margin: NDArray[np.float64]) -> Boxes:
        """The boxes, each larger by its margin, (K,), on every side."""
        return Boxes(self.low - margin[:, None], self.high + margin[:, None])


class Planes(NamedTuple):
    """K planes that bound a convex region: n.x <= d is inside."""

    n: NDArray[np.float64]  # (K, 3) unit
    d: NDArray[np.float64]  # (K,)


class SecondaryRays(NamedTuple):
    """What decides the extent of secondary rays from visible geometry."""

    lights: Sequence[Light]  # lights that cast shadows
    obscurance_reach: float  # of obscurance rays [radii]; 0 where none are cast


def frustum(
    camera: Camera, render_space: RenderSpace, width: int, height: int, film_filter: PixelFilter | None
) -> Planes:
    """Five planes around all camera rays of a view, in radii: the four sides, and the plane through the eye.

    Parameters
    ----------
    film_filter
        The pixel filter, None if each pixel has one ray through its centre.
    """
    # Half the size of the image plane, enlarged by the reach of the filter.
    right, up, forward = axes(camera)
    eye = render_space.from_world(camera.position)
    ends = np.array([0.0, 0.5, 1 - 2.0**-32])
    u, v = (each.ravel() for each in np.meshgrid(ends, np.arange(65) / 64))
    spread = max(float(np.abs(part).max()) for part in offsets(u, v, film_filter))
    x, y = (width - 1 + 2 * spread) / height, (height - 1 + 2 * spread) / height

    if camera.projection == "perspective":
        slope = np.tan(np.radians(camera.fov) / 2)
        x, y = slope * x, slope * y
        n = np.stack([*(side * right - x * forward for side in (1, -1)),
                      *(side * up - y * forward for side in (1, -1)), -forward])  # fmt: skip
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        return Planes(n, n @ eye)
    half = camera.extent / 2 / render_space.radius
    n = np.stack([right, -right, up, -up, -forward])
    return Planes(n, n @ eye + half * np.array([x, x, y, y, 0]))


def outside_frustum(planes: Planes, boxes: Boxes) -> NDArray[np.bool_]:
    """(K,) True for boxes that lie wholly outside one of the planes."""
    n, d = planes
    nearest = np.where(n[:, None] > 0, boxes.low, boxes.high)
    beyond = np.einsum("pki,pi->pk", nearest, n) > d[:, None] + BOX_MARGIN
    return np.asarray(beyond.any(axis=0))


def clip_boxes(planes: Planes, boxes: Boxes) -> Positions:
    """(V, 3) corners of the intersection of each of K boxes with the region inside the planes.

    Every three of the planes and the box's own six meet in a point; corners are those inside all others.
    """
    n = np.concatenate([planes.n, np.eye(3), -np.eye(3)])
    clipping = np.broadcast_to(planes.d + BOX_MARGIN, (len(boxes.low), len(planes.d)))
    d = np.concatenate([clipping, boxes.high, -boxes.low], axis=1)
    triples = np.array(list(itertools.combinations(range(len(n)), 3)))
    triples = triples[np.abs(np.linalg.det(n[triples])) > PARALLEL]
    corners = np.einsum("tij,ktj->kti", np.linalg.inv(n[triples]), d[:, triples])
    inside = (corners @ n.T <= d[:, None] + BOX_MARGIN).all(axis=2)
    return corners[inside]


def shadow_hull(points: Positions, light: Light, render_space: RenderSpace) -> Positions:
    """The points and the ends of their shadow rays; the hull of both contains all shadow rays from the hull
    of the points.

    A light is a point or infinitely far away. Long rays are cut outside the scene, all at the same fraction
    of their length.
    """
    to_light = light.sample_at(column_major(points), render_space)
    nearest = float(to_light.distance.min())
    if np.isinf(nearest):
        ends = points + SHADOW_REACH * to_light.l
    else:
        fraction = min(1.0, SHADOW_REACH / max(nearest, SHADOW_REACH / 2))
        ends = points + fraction * to_light.distance[:, None] * to_light.l
    return np.concatenate([points, ends])


def separated(points: Positions, boxes: Boxes, gap: float) -> NDArray[np.bool_]:
    """(K,) True for boxes that a separating plane proves to be farther than `gap` from the points' hull."""
    count = len(boxes.low)
    if count > (at_once := max(1, PAIRS_AT_ONCE // len(points))):
        parts = [slice(first, first + at_once) for first in range(0, count, at_once)]
        return np.concatenate([separated(points, boxes.take(part), gap) for part in parts])

    # Gilbert's iteration on the differences hull - box, from the difference of the centres.
    out = np.zeros(count, np.bool_)
    nearest = points.mean(axis=0) - (boxes.low + boxes.high) / 2
    undecided = np.arange(count)
    for _ in range(MAX_STEPS):
        # The support point of hull - box against `nearest`. If it is farther than the gap from the origin
        # along `nearest`, the plane through it separates the two.
        corner = np.where(nearest > 0, boxes.high[undecided], boxes.low[undecided])
        back = points[np.argmin(points @ nearest.T, axis=0)] - corner
        size = np.linalg.norm(nearest, axis=1)
        is_separated = np.einsum("ki,ki->k", back, nearest) > gap * size
        out[undecided[is_separated]] = True

        # `nearest` is the difference of a point of each: if it is short, the two are closer than the gap.
        rest = np.flatnonzero(~is_separated & (size > gap))
        undecided, nearest = undecided[rest], nearest[rest]
        if not len(undecided):
            break

        # Continue from the point nearest to the origin on the segment to the support point.
        step = back[rest] - nearest
        length2 = np.einsum("ki,ki->k", step, step)
        share = -np.einsum("ki,ki->k", nearest, step) / np.maximum(length2, np.finfo(np.float64).tiny)
        nearest = nearest + np.clip(share, 0, 1)[:, None] * step
    return out


def merge_boxes(boxes: Boxes) -> Boxes:
    """Boxes that together contain all of K boxes: the same if there are few, otherwise fewer, larger ones."""
    low, high = boxes
    if len(low) <= LARGE_BOXES + GROUPED_BOXES:
        return boxes
    by_size = np.argsort(-np.linalg.norm(high - low, axis=1), kind="stable")
    large, others = by_size[:LARGE_BOXES], by_size[LARGE_BOXES:]
    others = others[compact((low[others] + high[others]) / 2)]
    groups = [*large[:, None], *np.array_split(others, GROUPED_BOXES)]
    return Boxes(
        np.array([low[group].min(axis=0) for group in groups]),
        np.array([high[group].max(axis=0) for group in groups]),
    )


def culled_objects(
    boxes: Boxes,
    widths: NDArray[np.float64],
    views: Sequence[Planes],
    rays: SecondaryRays,
    render_space: RenderSpace,
) -> NDArray[np.bool_]:
    """(O,) True for objects that cannot change any image.

    Parameters
    ----------
    boxes : Boxes
        Bounds of the objects [radii]; inf and -inf for an object without polygons, which is never culled.
    widths : (O,)
        Diagonal of each object's largest polygon [radii], 0 without terminator correction. It bounds the
        terminator offset and the search for nearby objects (`shadows`).
    views : sequence of Planes
        The frustum of each view, at least one.
    """
    # Only objects outside every frustum can be culled.
    real = np.isfinite(boxes.low).all(axis=1)
    outside = np.array([real & outside_frustum(planes, boxes) for planes in views])
    out = np.asarray(outside.all(axis=0))
    if not out.any():
        return out

    # The visible part of the other objects, enlarged by the offsets of their secondary rays.
    enlarged = boxes.enlarged(BOX_MARGIN + TERMINATOR_SHARE * widths)
    visible = np.concatenate(
        [
            clip_boxes(planes, merge_boxes(enlarged.take(in_view)))
            for planes, in_view in zip(views, real & ~outside, strict=True)
        ]
    )
    if not len(visible):
        return out

    # Keep the candidates that its obscurance rays, search for nearby objects or shadow rays can reach.
    nearby = NEARBY * widths[real & ~outside.all(axis=0)].max(initial=0)
    hulls = [(visible, BOX_MARGIN + max(rays.obscurance_reach, nearby))]
    hulls += [(shadow_hull(visible, light, render_space), BOX_MARGIN) for light in rays.lights]
    for points, gap in hulls:
        candidates = np.flatnonzero(out)
        out[candidates] = separated(points, boxes.take(candidates), gap)
    return out
