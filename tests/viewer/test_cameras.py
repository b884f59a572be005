"""Cameras that a mouse moves."""

from __future__ import annotations

import math

import numpy as np
import pytest

from illumcli.rays.camera import axes
from illumcli.scene.spec import Orthographic, Perspective
from illumcli.viewer.cameras import dollied, orbited, panned, placement

CAMERAS = [
    Perspective(position=(1, 2, 3), target=(0.5, 0, 0), fov=40),
    Perspective(position=(1, 2, 3), target=(0.5, 0, 0), up=(0, 0, 2), fit="ball"),
    Orthographic(projection="orthographic", position=(0, 4, -3), target=(0, 0, 1), extent=3),
    Perspective(position=(2e5, 1e5, 0), target=(0, 0, 0)),
    Perspective(position=(1e-5, 2e-5, 0), target=(0, 0, 0)),
]
cameras = pytest.mark.parametrize("camera", CAMERAS, ids=range(len(CAMERAS)))


def place(camera, point):
    """Where a point is in the picture, in heights from its middle, downwards."""
    right, up, forward = axes(camera)
    offset = np.subtract(point, camera.position)
    if camera.projection == "orthographic":
        height = camera.extent
    else:
        height = 2 * (offset @ forward) * math.tan(math.radians(camera.fov) / 2)
    return offset @ right / height, -(offset @ up) / height


@cameras
def test_orbit_keeps_target_distance_and_horizon(camera):
    turned = orbited(camera, 0.3, -0.1)
    distance = math.dist(camera.position, camera.target)
    assert math.dist(turned.position, turned.target) == pytest.approx(distance, rel=1e-5)
    assert turned.target == pytest.approx(camera.target, abs=1e-6 * distance)
    assert turned.up == camera.up
    right, _, _ = axes(turned)
    assert right @ np.asarray(camera.up) == pytest.approx(0, abs=1e-5)
    back = orbited(turned, -0.3, 0.1)
    assert math.dist(back.position, camera.position) < 1e-4 * distance


@cameras
def test_orbit_follows_the_mouse(camera):
    """What is in front moves with the mouse: to the right, then downwards."""
    _, _, forward = axes(camera)
    distance = math.dist(camera.position, camera.target)
    front = np.asarray(camera.target) - 0.1 * distance * forward
    assert place(orbited(camera, 0.05, 0), front)[0] > 0
    assert place(orbited(camera, 0, 0.05), front)[1] > 0


@cameras
@pytest.mark.parametrize("dy", [-5.0, 5.0])
def test_orbit_stays_off_the_poles(camera, dy):
    turned = orbited(orbited(camera, 0, dy), 0.1, dy)
    up = np.asarray(camera.up) / np.linalg.norm(camera.up)
    _, _, forward = axes(turned)
    assert abs(math.degrees(math.asin(forward @ up))) == pytest.approx(89, abs=0.01)


def test_orbit_leaves_a_pole_that_the_scene_looks_from():
    above = Perspective(position=(0, 5, 0), target=(0, 0, 0))
    turned = orbited(above, 0.1, -0.2)
    assert math.dist(turned.position, (0, 0, 0)) == pytest.approx(5, rel=1e-5)
    assert 0 < turned.position[1] < 4.9


@cameras
def test_pan_moves_the_target_with_the_mouse(camera):
    moved = panned(camera, 0.2, -0.1)
    assert place(moved, camera.target) == pytest.approx((0.2, -0.1), abs=1e-4)
    assert np.subtract(moved.position, moved.target) == pytest.approx(
        np.subtract(camera.position, camera.target),
        rel=1e-4,
        abs=1e-5 * math.dist(camera.position, camera.target),
    )


@cameras
def test_dolly_enlarges_by_its_exponential(camera):
    nearer = dollied(camera, math.log(2))
    _, up, _ = axes(camera)
    above = np.asarray(camera.target) + 0.01 * math.dist(camera.position, camera.target) * up
    assert place(nearer, above)[1] == pytest.approx(2 * place(camera, above)[1], rel=1e-4)
    assert dollied(nearer, -math.log(2)).position == pytest.approx(camera.position, rel=1e-5)


@cameras
def test_placement_is_what_a_scene_says(camera):
    parts = placement(panned(camera, 0.1, 0.1))
    assert parts["fit"] is None
    given = {name: value for name, value in parts.items() if value is not None}
    again = type(camera).model_validate({"projection": camera.projection, **given})
    assert again.position == panned(camera, 0.1, 0.1).position
