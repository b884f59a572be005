"""Pixel samples to rays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Lanes, Vectors, columns, dot, unit
from illumcli.frame import Frame


def axes(camera: Any) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors right, up and forward, (3,) each; `up` along the line of sight is replaced."""
    forward = np.asarray(camera.target, np.float64) - camera.position
    forward /= np.abs(forward).max()
    forward /= np.linalg.norm(forward)
    up = np.asarray(camera.up, np.float64) / np.abs(camera.up).max()
    right = np.cross(forward, up / np.linalg.norm(up))
    if np.linalg.norm(right) < 1e-9:
        right = np.cross(forward, np.eye(3)[np.argmin(np.abs(forward))])
    right /= np.linalg.norm(right)
    return right, np.cross(right, forward), forward


def camera_rays(
    camera: Any, frame: Frame, width: int, height: int, points: NDArray[np.float64]
) -> tuple[Vectors, Vectors, Lanes]:
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
    skipped : (N,) float64
        How far each origin lies from the eye or the view plane, in radii.
    """
    right, up, forward = axes(camera)
    x = (2 * points[:, 0] - width) / height
    y = 1 - 2 * points[:, 1] / height
    eye = frame.inward(camera.position)
    if camera.projection == "perspective":
        slope = np.tan(np.radians(camera.fov) / 2)
        way = columns(forward + (slope * x)[:, None] * right + (slope * y)[:, None] * up)
        d = unit(way)
        o = np.broadcast_to(eye, d.shape)
    else:
        half = camera.extent / 2 / frame.radius
        o = columns(eye + (half * x)[:, None] * right + (half * y)[:, None] * up)
        d = np.broadcast_to(forward, o.shape)
    skipped = entry(o, d)
    start = o + skipped[:, None] * d
    return columns(start, F), columns(d, F), skipped


def entry(o: Vectors, d: Vectors) -> Lanes:
    """(N,) distance along `d` to a little before the sphere of radius 1; 0 for rays that start near it.

    A ray that misses the sphere starts where it passes nearest.
    """
    return np.maximum(-dot(o, d) - 1.25, 0.0)


def film_points(
    x: NDArray[np.int64], y: NDArray[np.int64], spread: NDArray[np.float64], film_filter: Any
) -> NDArray[np.float64]:
    """(N, 2) film positions [pixels]: each pixel's centre plus `spread` in [0, 1)^2 through the filter.

    Positions are drawn from the pixel filter itself, so that every sample weighs the same and no pixel
    needs its neighbours' samples.
    """
    out = np.empty((len(x), 2), order="F")
    width = film_filter.width
    if film_filter.filter == "gaussian":
        # radius of a Gaussian of deviation width / 4, cut off at width, by inversion
        deviation = width / 4
        inside = -np.expm1(-(width**2) / (2 * deviation**2))
        r = deviation * np.sqrt(-2 * np.log1p(-spread[:, 0] * inside))
        angle = 2 * np.pi * spread[:, 1]
        offset = np.stack([r * np.cos(angle), r * np.sin(angle)], axis=1)
    elif film_filter.filter == "tent":
        low = spread < 0.5
        offset = width / 2 * np.where(low, np.sqrt(2 * spread) - 1, 1 - np.sqrt(2 * (1 - spread)))
    else:
        offset = width * (spread - 0.5)
    out[:, 0] = x + 0.5 + offset[:, 0]
    out[:, 1] = y + 0.5 + offset[:, 1]
    return out
