"""Which objects no picture can tell the presence of, by their boxes alone.

An object is left out only where planes prove it: one between it and every view, and one between it and all
that a view sees together with the ways from there to each light, and out of reach of obscurance rays. Boxes
and hulls are larger than what they hold and the search for planes gives up early, so the answer errs by
keeping objects.

References
----------
Gilbert, E. G. (1966). An iterative procedure for computing the minimum of a quadratic form on a convex set.
SIAM J. Control 4(1): the walk towards the nearest point, each step of which offers a separating plane.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import column_major
from illumcli.geometry.spatial_order import compact
from illumcli.lights._base import Light
from illumcli.rays.camera import axes, offsets
from illumcli.render_space import RenderSpace
from illumcli.visibility.shadows import NEARBY, TERMINATOR_SHARE

ROOM = 1e-4
"""Radii by which everything is taken to be larger: rays in single precision, the second shot of rays that
miss and the starts of secondary rays together stray by a tenth of it."""
BEYOND = 20.0
"""Radii that a way to a light is followed for: out of the scene from any point near it."""
STEPS = 40
PARALLEL = 1e-9
AT_ONCE = 1 << 20
LARGE, GROUPS = 8, 16
"""Of many boxes so many of the largest stand alone; so many boxes hold the others, those that lie close
together."""

Points = NDArray[np.float64]
Planes = tuple[NDArray[np.float64], NDArray[np.float64]]  # (K, 3) unit n and (K,) d: n.x <= d is inside


def frustum(camera: Any, frame: RenderSpace, width: int, height: int, film_filter: Any | None) -> Planes:
    """Five planes around all that a view's rays pass: four sides, and the eye's own; in radii.

    Parameters
    ----------
    film_filter
        The pixel filter, None where each pixel looks through its centre.
    """
    right, up, forward = axes(camera)
    eye = frame.from_world(camera.position)
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
        return n, n @ eye
    half = camera.extent / 2 / frame.radius
    n = np.stack([right, -right, up, -up, -forward])
    return n, n @ eye + half * np.array([x, x, y, y, 0])


def outside(planes: Planes, low: Points, high: Points) -> NDArray[np.bool_]:
    """(K,) True for boxes that lie beyond one of the planes as a whole."""
    n, d = planes
    nearest = np.where(n[:, None] > 0, low, high)
    beyond = np.einsum("pki,pi->pk", nearest, n) > d[:, None] + ROOM
    told: NDArray[np.bool_] = beyond.any(axis=0)
    return told


def within(planes: Planes, low: Points, high: Points) -> Points:
    """(V, 3) the corners of what each of (K, 3) boxes has in common with the inside of the planes."""
    n = np.concatenate([planes[0], np.eye(3), -np.eye(3)])
    d = np.concatenate([np.broadcast_to(planes[1] + ROOM, (len(low), len(planes[1]))), high, -low], axis=1)
    three = np.array(list(itertools.combinations(range(len(n)), 3)))
    three = three[np.abs(np.linalg.det(n[three])) > PARALLEL]
    corners = np.einsum("tij,ktj->kti", np.linalg.inv(n[three]), d[:, three])
    inside = (corners @ n.T <= d[:, None] + ROOM).all(axis=2)
    return corners[inside]


def ways(points: Points, light: Light, frame: RenderSpace) -> Points:
    """The points and where the ways from them to a light end: their hull holds the ways from all its points.

    A light is one point or infinitely far away; a long way ends where nothing can stand any more, for all
    points at the same share of it.
    """
    arriving = light.arriving(column_major(points), frame)
    nearest = float(arriving.distance.min())
    if np.isinf(nearest):
        ends = points + BEYOND * arriving.l
    else:
        share = min(1.0, BEYOND / max(nearest, BEYOND / 2))
        ends = points + share * arriving.distance[:, None] * arriving.l
    return np.concatenate([points, ends])


def apart(points: Points, low: Points, high: Points, gap: float) -> NDArray[np.bool_]:
    """(K,) True for boxes that a plane shows to be farther than `gap` from the hull of the points."""
    if len(low) > (some := max(1, AT_ONCE // len(points))):
        parts = [slice(first, first + some) for first in range(0, len(low), some)]
        return np.concatenate([apart(points, low[part], high[part], gap) for part in parts])
    found = np.zeros(len(low), np.bool_)
    way = points.mean(axis=0) - (low + high) / 2
    left = np.arange(len(low))
    for _ in range(STEPS):
        # the corner of (hull - box) that lies farthest back along the way
        back = points[np.argmin(points @ way.T, axis=0)] - np.where(way > 0, high[left], low[left])
        size = np.linalg.norm(way, axis=1)
        told = np.einsum("ki,ki->k", back, way) > gap * size
        found[left[told]] = True
        # the way leads from a point of the box to one of the hull: a short one proves the opposite
        on = np.flatnonzero(~told & (size > gap))
        left, way = left[on], way[on]
        if not len(left):
            break
        step = back[on] - way
        length = np.einsum("ki,ki->k", step, step)
        share = -np.einsum("ki,ki->k", way, step) / np.maximum(length, np.finfo(np.float64).tiny)
        way = way + np.clip(share, 0, 1)[:, None] * step
    return found


def fewer(low: Points, high: Points) -> tuple[Points, Points]:
    """Boxes that hold all of (K, 3) boxes: these, or where they are many fewer and larger ones."""
    if len(low) <= LARGE + GROUPS:
        return low, high
    by_size = np.argsort(-np.linalg.norm(high - low, axis=1), kind="stable")
    large, others = by_size[:LARGE], by_size[LARGE:]
    others = others[compact((low[others] + high[others]) / 2)]
    groups = [*large[:, None], *np.array_split(others, GROUPS)]
    return np.array([low[g].min(axis=0) for g in groups]), np.array([high[g].max(axis=0) for g in groups])


def unseen(
    low: Points,
    high: Points,
    widths: NDArray[np.float64],
    views: Sequence[Planes],
    lights: Iterable[Light],
    reach: float,
    frame: RenderSpace,
) -> NDArray[np.bool_]:
    """(O,) True for objects that change no picture.

    Parameters
    ----------
    low, high : (O, 3)
        Corners of the objects' boxes, in radii; inf and -inf for one without polygons, which is never told.
    widths : (O,)
        The widest polygon of each object whose shadow rays may start on the surface that its normals imply,
        in radii: they start within a share of it and look for other things nearby (`shadows`).
    views : sequence of (n, d)
        What bounds each, at least one, as `frustum` gives it.
    lights : iterable of Light
        Those that cast shadows.
    reach : float
        Of obscurance rays, in radii; 0 where none are cast.
    """
    real = np.isfinite(low).all(axis=1)
    beyond = np.array([real & outside(planes, low, high) for planes in views])
    found = np.asarray(beyond.all(axis=0))
    if not found.any():
        return found
    more = (ROOM + TERMINATOR_SHARE * widths)[:, None]
    seen = np.concatenate(
        [
            within(planes, *fewer((low - more)[mine], (high + more)[mine]))
            for planes, mine in zip(views, real & ~beyond, strict=True)
        ]
    )
    if not len(seen):
        return found
    near = NEARBY * widths[real & ~beyond.all(axis=0)].max(initial=0)
    for points, gap in [
        (seen, ROOM + max(reach, near)),
        *((ways(seen, light, frame), ROOM) for light in lights),
    ]:
        which = np.flatnonzero(found)
        found[which] = apart(points, low[which], high[which], gap)
    return found
