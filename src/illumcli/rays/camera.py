"""Pixel samples to rays."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors, column_major
from illumcli.geometry.bounds import ObjectBounds, transformed_vertices
from illumcli.geometry.extent import take_used
from illumcli.geometry.mesh import Mesh
from illumcli.rays.compiled_samples import sample_loop
from illumcli.rays.viewpoints import Camera, PixelFilter, Point
from illumcli.records import Record
from illumcli.render_space import RenderSpace

PARALLEL = 1e-9
"""Sine of the angle below which `up` is taken to point along the line of sight."""


def axes(camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
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
"""Share of the image's width and height that stays empty around a framed object, half on either side."""


def framing(camera: Camera, aspect: float, points: NDArray[np.float64]) -> Camera:
    """The camera, moved without turning so that all points lie inside the image and fill it.

    A pinhole at e sees p between the left and right edges of the image if |r.(p - e)| <= s f.(p - e), with
    r pointing right, f forward and s the slope of the edges. Over all points this bounds f.e from above; the
    lower and upper edges give a second bound. The eye takes the smaller one and is then centred: the
    projected points extend equally far to both sides.

    Parameters
    ----------
    aspect : float
        Width of the image over its height.
    points : (N, 3) float64
        At least one [scene units].
    """
    # Points in the camera's axes, relative to the centre of their bounding box.
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    x, y, z = ((points - centre) @ axis for axis in axes(camera))
    size = float(np.linalg.norm(points - centre, axis=1).max()) or 1.0
    nearest = float(z.min())
    inside = 1 - MARGIN
    if camera.projection == "perspective":
        # Move back until all points project inside the margins, then across until they are centred.
        slope = inside * np.tan(np.radians(camera.fov) / 2)
        bounds = _depth_bound(x, z, slope * aspect), _depth_bound(y, z, slope)
        eye_z = min(*bounds, nearest - CLOSEST * size)
        eye_x, eye_y = (_centred(part, z - eye_z) for part in (x, y))
        changes: dict[str, object] = {}
    else:
        # Parallel rays: the size of the image decides, not the distance.
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


Placement: TypeAlias = tuple[Point, Point, float | None]
"""Position, target and, for orthographic cameras, extent."""


def framed(
    camera: Camera, aspect: float, number: int, meshes: Sequence[Mesh], object_bounds: ObjectBounds
) -> Placement:
    """Placement of the camera at which object `number` fills the image."""
    mesh = meshes[number]
    points = take_used(mesh, transformed_vertices(mesh, object_bounds.matrices[number]))
    placed = framing(camera, aspect, points)
    return placed.position, placed.target, getattr(placed, "extent", None)


CLOSEST = 1e-3
"""Least distance of the eye from the nearest point of a framed object, in radii of the object."""


def _depth_bound(x: Floats, z: Floats, slope: float) -> float:
    """Largest depth of an eye that sees all points between two opposite edges of the image."""
    return -float((x - slope * z).max() + (-x - slope * z).max()) / (2 * slope)


def _centred(x: Floats, depth: Floats) -> float:
    """The eye's coordinate at which the projections x / depth extend equally far to both sides."""
    eye = float(x.min() + x.max()) / 2
    for _ in range(16):  # only the two outermost points count; once these no longer change, `eye` is exact
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
    """Camera rays, one for each of N samples."""

    origins: Vectors
    directions: Vectors
    start_distance: Floats  # (N,) float64 from the eye to the origin, in radii


def camera_rays(
    camera: Camera, render_space: RenderSpace, width: int, height: int, points: NDArray[np.float64]
) -> Rays:
    """Rays through film positions, in radii from the scene's centre.

    Parameters
    ----------
    points : (N, 2) float64
        Film positions [pixels], from the upper left corner.

    Returns
    -------
    origins, directions : (N, 3) float32
        Each ray starts shortly before it enters the scene's bounding sphere; the start is computed in
        float64, so that a camera a million radii away loses no precision. Directions have unit length.
    start_distance : (N,) float64
        Distance of each origin from the eye or the view plane, in radii.
    """
    right, up, forward = axes(camera)
    eye = render_space.from_world(camera.position)
    if camera.projection == "perspective":
        pinhole = {
            "right": right,
            "up": up,
            "forward": forward,
            "eye": eye,
            "right_eye": right @ eye,
            "up_eye": up @ eye,
            "forward_eye": forward @ eye,
            "slope": np.tan(np.radians(camera.fov) / 2),
            "width": width,
            "height": height,
        }
        loop = sample_loop()
        return Rays(*(loop.camera_rays(pinhole, points) if loop else _pinhole_rays(pinhole, points)))

    # Parallel rays from the view plane, which moves to the sphere as a whole.
    x, y = _on_image_plane(points, width, height)
    half = camera.extent / 2 / render_space.radius
    d = np.broadcast_to(forward, (len(x), 3))
    plane = _weighted_sum((half * x, right), (half * y, up))
    start_distance = np.full(len(x), max(-(forward @ eye) - CLEAR, 0))
    start = eye + start_distance[0] * forward + plane if len(x) else plane
    return Rays(column_major(start, F), column_major(d, F), start_distance)


def _on_image_plane(points: NDArray[np.float64], width: int, height: int) -> tuple[Floats, Floats]:
    """Coordinates of film positions on an image plane of height 2, y upwards."""
    return (2 * points[:, 0] - width) / height, 1 - 2 * points[:, 1] / height


def _pinhole_rays(pinhole: Mapping[str, Any], points: NDArray[np.float64]) -> tuple[Vectors, Vectors, Floats]:
    """The origins, directions and distances of the starts of rays; as the compiled loop computes them."""
    # Unit directions; right, up and forward are orthonormal, so lengths need no vector.
    x, y = (pinhole["slope"] * each for each in _on_image_plane(points, pinhole["width"], pinhole["height"]))
    scale = 1 / np.sqrt(1 + x * x + y * y)
    x *= scale
    y *= scale
    d = _weighted_sum((scale, pinhole["forward"]), (x, pinhole["right"]), (y, pinhole["up"]))

    # Move each origin along its ray to the scene's sphere.
    along = -(scale * pinhole["forward_eye"] + x * pinhole["right_eye"] + y * pinhole["up_eye"])
    start_distance = np.maximum(along - CLEAR, 0)
    start = pinhole["eye"] + start_distance[:, None] * d
    return column_major(start, F), column_major(d, F), start_distance


CLEAR = 1.25
"""Rays start this far before the point where they are closest to the scene's centre: outside its sphere of
radius 1."""


def _weighted_sum(*terms: tuple[Floats, NDArray[np.float64]]) -> Vectors:
    """(N, 3) float64 sum of vectors, (3,), each times a weight per ray, (N,)."""
    out = np.empty((len(terms[0][0]), 3), order="F")
    for k in range(3):
        weight, vector = terms[0]
        np.multiply(weight, vector[k], out=out[:, k])
        for weight, vector in terms[1:]:
            out[:, k] += weight * vector[k]
    return out


def film_points(
    x: NDArray[np.int64], y: NDArray[np.int64], spread: NDArray[np.float64], film_filter: PixelFilter | None
) -> NDArray[np.float64]:
    """(N, 2) film positions [pixels]: each pixel's centre plus an offset drawn from the pixel filter.

    Filter importance sampling: every sample has the same weight, and no pixel needs its neighbours' samples.
    Without a filter the positions are the centres.

    Parameters
    ----------
    x, y : (P,) int
        Pixels.
    spread : (N, 2) float64
        In [0, 1)^2, N / P points per pixel, one pixel after the other.
    """
    out = np.empty((len(spread), 2), order="F")
    a, b = offsets(spread[:, 0], spread[:, 1], film_filter)
    np.add(a.reshape(len(x), -1), (x + 0.5)[:, None], out=out[:, 0].reshape(len(x), -1))
    np.add(b.reshape(len(y), -1), (y + 0.5)[:, None], out=out[:, 1].reshape(len(y), -1))
    return out


def offsets(u: Floats, v: Floats, film_filter: PixelFilter | None) -> tuple[Floats, Floats]:
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
    # Gaussian of standard deviation width / 4, cut off at `width`, in polar coordinates.
    deviation = width / 4
    inside = -np.expm1(-(width**2) / (2 * deviation**2))
    r = deviation * np.sqrt(-2 * np.log1p(-u * inside))
    angle = 2 * np.pi * v
    return r * np.cos(angle), r * np.sin(angle)


def footprint(film_filter: PixelFilter) -> tuple[int, float]:
    """Pixels that a filter reaches from a pixel, and its variance as a multiple of a box's of one pixel."""
    width = film_filter.width
    if film_filter.filter == "box":
        return max(1, math.ceil(width / 2)), width**2
    if film_filter.filter == "tent":
        return max(1, math.ceil(width / 2)), width**2 / 2
    return max(1, math.ceil(0.75 * width)), 0.75 * width**2  # three deviations of width / 4
