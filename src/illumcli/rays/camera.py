"""Pixel samples to rays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors, column_major
from illumcli.geometry.bounds import ObjectBounds, take_used, transformed_vertices
from illumcli.geometry.mesh import Mesh
from illumcli.records import Record
from illumcli.render_space import RenderSpace

PARALLEL = 1e-9
"""Sine of the angle below which `up` is taken to point along the line of sight."""


def axes(camera: Any) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors right, up and forward, (3,) each; `up` along the line of sight is replaced."""
    forward = np.asarray(camera.target, np.float64) - camera.position
    forward /= np.abs(forward).max()
    forward /= np.linalg.norm(forward)
    up = np.asarray(camera.up, np.float64) / np.abs(camera.up).max()
    right = np.cross(forward, up / np.linalg.norm(up))
    if np.linalg.norm(right) < PARALLEL:
        # rounded, so that a camera moved along its line of sight keeps its axes
        right = np.cross(forward, np.eye(3)[np.argmin(np.abs(forward).round(9))])
    right /= np.linalg.norm(right)
    return right, np.cross(right, forward), forward


MARGIN = 0.1
"""Share of the picture's width and height that a framed object leaves free, half of it on either side."""


def framing(camera: Any, aspect: float, points: NDArray[np.float64]) -> Any:
    """The camera with its direction, placed so that all points are inside the picture and fill it.

    A pinhole at e sees p between two edges of the picture where |r.(p - e)| <= s f.(p - e), r pointing right,
    f forward, s the slope of the edges: the two edges together bound f.e. The same holds for up. At the
    nearer of the two bounds e moves across to where the points reach as far to either side.

    Parameters
    ----------
    aspect : float
        Width of the picture over its height.
    points : (N, 3) float64
        At least one [scene units].
    """
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    x, y, z = ((points - centre) @ axis for axis in axes(camera))
    size = float(np.linalg.norm(points - centre, axis=1).max()) or 1.0
    nearest = float(z.min())
    inside = 1 - MARGIN
    if camera.projection == "perspective":
        slope = inside * np.tan(np.radians(camera.fov) / 2)
        bounds = _between_edges(x, z, slope * aspect), _between_edges(y, z, slope)
        eye_z = min(*bounds, nearest - CLOSEST * size)
        eye_x, eye_y = (_amid(part, z - eye_z) for part in (x, y))
        changes = {}
    else:
        eye_x, eye_y = ((float(part.min()) + float(part.max())) / 2 for part in (x, y))
        extent = max(float(np.ptp(y)), float(np.ptp(x)) / aspect) / inside
        eye_z = nearest - size
        changes = {"extent": extent or size}
    right, up, forward = axes(camera)
    position = centre + eye_x * right + eye_y * up + eye_z * forward
    target = position - eye_z * forward
    return camera.model_copy(
        update={"position": _tuple(position), "target": _tuple(target), "fit": None, **changes}
    )


Placement: TypeAlias = tuple[tuple[float, float, float], tuple[float, float, float], float | None]
"""Position, target and, of orthographic cameras, extent."""


def framed(
    camera: Any, aspect: float, number: int, meshes: Sequence[Mesh], object_bounds: ObjectBounds
) -> Placement:
    """Where a camera stands whose picture the object of this number fills."""
    mesh = meshes[number]
    points = take_used(mesh, transformed_vertices(mesh, object_bounds.matrices[number]))
    placed = framing(camera, aspect, points)
    return placed.position, placed.target, getattr(placed, "extent", None)


CLOSEST = 1e-3
"""A framed object that hides behind one of its own points is seen from this far off it, in its radii."""


def _between_edges(x: Floats, z: Floats, slope: float) -> float:
    """How far along the line of sight an eye can be that has all points between two edges of its view."""
    return -float((x - slope * z).max() + (-x - slope * z).max()) / (2 * slope)


def _amid(x: Floats, depth: Floats) -> float:
    """The place across from which points of these depths reach as far to either side in the picture."""
    eye = float(x.min() + x.max()) / 2
    for _ in range(16):  # two points decide; where they stay the same the place is exact
        slopes = (x - eye) / depth
        ends = [int(slopes.argmin()), int(slopes.argmax())]
        weights = 1 / depth[ends]
        last, eye = eye, float(weights @ x[ends] / weights.sum())
        if eye == last:
            break
    return eye


def _tuple(vector: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(vector[0]), float(vector[1]), float(vector[2])


class Rays(Record):
    """Primary rays."""

    origins: Vectors
    directions: Vectors
    start_distance: Floats  # (N,) float64 from the eye to the origin, in radii


def camera_rays(
    camera: Any, render_space: RenderSpace, width: int, height: int, points: NDArray[np.float64]
) -> Rays:
    """Rays through film positions, in radii from the scene's centre.

    Parameters
    ----------
    points : (N, 2) float64
        Film positions [pixels], from the upper left corner.

    Returns
    -------
    origins, directions : (N, 3) float32
        Each ray starts where it enters the scene's sphere, found in float64, so that a camera a million
        radii away loses nothing. Directions have unit length.
    start_distance : (N,) float64
        How far each origin lies from the eye or the view plane, in radii.
    """
    right, up, forward = axes(camera)
    x = (2 * points[:, 0] - width) / height
    y = 1 - 2 * points[:, 1] / height
    eye = render_space.from_world(camera.position)
    if camera.projection == "perspective":
        slope = np.tan(np.radians(camera.fov) / 2)
        x, y = slope * x, slope * y
        # right, up and forward are orthonormal: the length needs no vector
        scale = 1 / np.sqrt(1 + x * x + y * y)
        x *= scale
        y *= scale
        d = _combined((scale, forward), (x, right), (y, up))
        along = -(scale * (forward @ eye) + x * (right @ eye) + y * (up @ eye))
        start_distance = np.maximum(along - CLEAR, 0)
        start = (
            _combined((np.broadcast_to(1.0, len(x)), eye))
            if not start_distance.any()
            else eye + start_distance[:, None] * d
        )
    else:
        half = camera.extent / 2 / render_space.radius
        d = np.broadcast_to(forward, (len(x), 3))
        plane = _combined((half * x, right), (half * y, up))
        start_distance = np.full(len(x), max(-(forward @ eye) - CLEAR, 0))
        start = eye + start_distance[0] * forward + plane if len(x) else plane
    return Rays(column_major(start, F), column_major(d, F), start_distance)


CLEAR = 1.25
"""Rays start this far before they pass the scene's centre, clear of its sphere of radius 1."""


def _combined(*terms: tuple[Floats, NDArray[np.float64]]) -> Vectors:
    """(N, 3) float64 sum of a weight per lane times a vector."""
    out = np.empty((len(terms[0][0]), 3), order="F")
    for k in range(3):
        weight, vector = terms[0]
        np.multiply(weight, vector[k], out=out[:, k])
        for weight, vector in terms[1:]:
            out[:, k] += weight * vector[k]
    return out


def film_points(
    x: NDArray[np.int64], y: NDArray[np.int64], spread: NDArray[np.float64], film_filter: Any | None
) -> NDArray[np.float64]:
    """(N, 2) film positions [pixels]: each pixel's centre plus `spread` in [0, 1)^2 through the filter.

    Positions are drawn from the pixel filter itself, so that every sample weighs the same and no pixel
    needs its neighbours' samples. Without a filter they are the centres.

    Parameters
    ----------
    x, y : (P,) int
        Pixels.
    spread : (N, 2) float64
        N / P points of each pixel, one pixel after the other.
    """
    out = np.empty((len(spread), 2), order="F")
    a, b = offsets(spread[:, 0], spread[:, 1], film_filter)
    np.add(a.reshape(len(x), -1), (x + 0.5)[:, None], out=out[:, 0].reshape(len(x), -1))
    np.add(b.reshape(len(y), -1), (y + 0.5)[:, None], out=out[:, 1].reshape(len(y), -1))
    return out


def offsets(u: Floats, v: Floats, film_filter: Any | None) -> tuple[Floats, Floats]:
    """Distances from the pixel's centre [pixels] of points drawn from the filter by inversion."""
    if film_filter is None:
        return np.zeros_like(u), np.zeros_like(v)
    width = film_filter.width
    if film_filter.filter == "box":
        return width * (u - 0.5), width * (v - 0.5)
    if film_filter.filter == "tent":
        first, second = (
            width / 2 * np.where(w < 0.5, np.sqrt(2 * w) - 1, 1 - np.sqrt(2 * (1 - w))) for w in (u, v)
        )
        return first, second
    # the radius of a Gaussian of deviation width / 4, cut off at width
    deviation = width / 4
    inside = -np.expm1(-(width**2) / (2 * deviation**2))
    r = deviation * np.sqrt(-2 * np.log1p(-u * inside))
    angle = 2 * np.pi * v
    return r * np.cos(angle), r * np.sin(angle)
