"""Cameras that a mouse moves: around their target, across the picture, along the line of sight."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from illumcli.rays.camera import axes
from illumcli.rays.viewpoints import Camera

STEEPEST = math.radians(89)
"""Greatest angle between the line of sight and the horizon: `up` stays off the line of sight."""
TURN = math.pi
"""A drag over the height of the picture turns the camera by so much [radians]."""
DIGITS = 6
"""Digits of places, relative to the distance between eye and target."""


def orbited(camera: Camera, dx: float, dy: float) -> Camera:
    """The camera after a drag that turns it around its target, `up` as the axis.

    Parameters
    ----------
    dx, dy : float
        To the right and downwards, in heights of the picture.
    """
    _, _, forward = axes(camera)
    up = np.asarray(camera.up, np.float64)
    up /= np.linalg.norm(up)

    # Turn about `up`, then raise or lower the eye, so far that it does not pass the poles.
    right = np.cross(forward, up)
    if np.linalg.norm(right) < 1e-6:
        right = axes(camera)[0]
    forward = _rotated(forward, up, -TURN * dx)
    right = _rotated(right / np.linalg.norm(right), up, -TURN * dx)
    height = math.asin(min(1.0, max(-1.0, float(-forward @ up))))
    turn = min(STEEPEST, max(-STEEPEST, height + TURN * dy)) - height
    forward = _rotated(forward, right, -turn)

    distance = _distance(camera)
    return _placed(camera, np.asarray(camera.target) - distance * forward, np.asarray(camera.target))


def panned(camera: Camera, dx: float, dy: float) -> Camera:
    """The camera after a drag that moves the target with the mouse; `dx`, `dy` as of `orbited`."""
    right, up, _ = axes(camera)
    shift = _height(camera) * (dy * up - dx * right)
    return _placed(camera, camera.position + shift, camera.target + shift)


def dollied(camera: Camera, amount: float) -> Camera:
    """The camera nearer to its target, by a factor exp(amount); with parallel rays a smaller extent."""
    factor = math.exp(-amount)
    if camera.projection == "orthographic":
        extent = camera.extent * factor
        return camera.model_copy(update={"extent": float(f"{extent:.{DIGITS}g}"), "fit": None})
    target = np.asarray(camera.target, np.float64)
    return _placed(camera, target - factor * (target - camera.position), target)


MOTIONS: Mapping[str, Callable[..., Camera]] = {"orbit": orbited, "pan": panned, "dolly": dollied}
"""How the mouse moves a camera."""


def placement(camera: Camera) -> Mapping[str, object]:
    """What a scene says of the place of a camera; null where the camera does not fit an object any more."""
    parts: dict[str, object] = {"position": list(camera.position), "target": list(camera.target), "fit": None}
    if camera.projection == "orthographic":
        parts["extent"] = camera.extent
    return parts


def _distance(camera: Camera) -> float:
    return math.dist(camera.target, camera.position)


def _height(camera: Camera) -> float:
    """Height of the picture at the target [scene units]."""
    if camera.projection == "orthographic":
        return camera.extent
    return 2 * _distance(camera) * math.tan(math.radians(camera.fov) / 2)


def _rotated(vector: NDArray[np.float64], axis: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """A vector turned about a unit axis (Rodrigues' formula)."""
    along = axis * (axis @ vector)
    return along + math.cos(angle) * (vector - along) + math.sin(angle) * np.cross(axis, vector)


def _placed(camera: Camera, position: NDArray[np.float64], target: NDArray[np.float64]) -> Camera:
    """The camera at another place, rounded as text shows it."""
    distance = math.dist(position, target)
    decimals = DIGITS - math.ceil(math.log10(distance))
    eye, end = (tuple(round(float(x), decimals) for x in place) for place in (position, target))
    return camera.model_copy(update={"position": eye, "target": end, "fit": None})
