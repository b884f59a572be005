"""Cameras: centre, corners, distance, and filters that keep their mean."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from illumcli.rays.camera import CLOSEST, MARGIN, axes, camera_rays, film_points, framing
from illumcli.render_space import RenderSpace
from illumcli.scene.spec import Filter, Orthographic, Perspective

UNIT = RenderSpace((0.0, 0.0, 0.0), 1.0)


def test_the_centre_looks_at_the_target_and_corners_open_by_the_field_of_view():
    camera = Perspective(position=(0.0, 0.0, 3.0), target=(0.0, 0.0, 0.0), fov=90.0)
    points = np.array([[100.0, 50.0], [100.0, 0.0], [0.0, 50.0], [200.0, 100.0]])
    rays = camera_rays(camera, UNIT, 200, 100, points)
    o, d, skipped = rays.origins, rays.directions, rays.start_distance
    np.testing.assert_allclose(d[0], [0, 0, -1], atol=1e-7)
    np.testing.assert_allclose(d[1], np.array([0, 1, -1]) / 2**0.5, atol=1e-7)
    np.testing.assert_allclose(d[2], np.array([-2, 0, -1]) / 5**0.5, atol=1e-7)
    np.testing.assert_allclose(d[3], np.array([2, -1, -1]) / 6**0.5, atol=1e-7)
    np.testing.assert_allclose(o + (0 - skipped[:, None]) * d, [[0, 0, 3]] * 4, atol=1e-6)


def test_orthographic_rays_are_parallel_and_span_the_extent():
    camera = Orthographic(
        projection="orthographic", position=(0.0, 0.0, 3.0), target=(0.0, 0.0, 0.0), extent=4.0
    )
    rays = camera_rays(camera, UNIT, 200, 100, np.array([[100.0, 0.0], [200.0, 50.0]]))
    o, d = rays.origins, rays.directions
    np.testing.assert_allclose(d, [[0, 0, -1]] * 2, atol=1e-7)
    np.testing.assert_allclose(o[:, :2], [[0, 2], [4, 0]], atol=1e-6)


def test_a_camera_a_million_radii_away_aims_as_well_as_a_near_one():
    for distance in (3.0, 1e6):
        camera = Orthographic(
            projection="orthographic", position=(0.3, 0.2, distance), target=(0.3, 0.2, 0.0)
        )
        rays = camera_rays(camera, UNIT, 100, 100, np.array([[50.5, 50.5]]))
        o, skipped = rays.origins, rays.start_distance
        np.testing.assert_allclose(o[0], [0.31, 0.19, 1.25], atol=1e-6)
        assert skipped[0] == pytest.approx(distance - 1.25)


@pytest.mark.parametrize("up", [(0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, -5.0)])
def test_axes_are_orthonormal_and_right_handed_even_with_up_along_the_view(up):
    camera = Perspective(position=(0.0, 0.0, 3.0), target=(0.0, 0.0, 0.0), up=up)
    right, true_up, forward = axes(camera)
    frame = np.array([right, true_up, -forward])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame) == pytest.approx(1)


@pytest.mark.parametrize(("name", "width"), [("box", 1.0), ("tent", 2.0), ("gaussian", 2.0)])
def test_filters_are_centred_bounded_and_have_their_deviation(name, width):
    side = 512
    grid = (np.stack(np.meshgrid(*[np.arange(side) + 0.5] * 2), axis=-1) / side).reshape(-1, 2)
    zero = np.zeros(len(grid), int)
    offset = film_points(zero, zero, grid, Filter(filter=name, width=width)) - 0.5
    deviation = {"box": width / 12**0.5, "tent": width / 24**0.5, "gaussian": width / 4}[name]
    np.testing.assert_allclose(offset.mean(axis=0), 0, atol=1e-3)
    np.testing.assert_allclose(offset.std(axis=0), deviation, rtol=5e-3)
    assert np.abs(offset).max() <= (width if name == "gaussian" else width / 2)


# framing

SHAPES = {
    "ball": (1, 1, 1), "flat": (1, 1e-9, 1), "needle": (1e-4, 1, 1e-4), "wide": (5, 1, 1), "deep": (1, 1, 9),
}  # fmt: skip


def in_picture(camera, aspect, points):
    """(2, N) where points are in the picture, -1..1 across and up, and their depths."""
    x, y, z = ((points - camera.position) @ axis for axis in axes(camera))
    is_pinhole = camera.projection == "perspective"
    half = z * np.tan(np.radians(camera.fov) / 2) if is_pinhole else camera.extent / 2
    return np.array([x / half / aspect, y / half]), z


@settings(max_examples=60, deadline=None)
@given(
    shape=st.sampled_from(sorted(SHAPES)),
    projection=st.sampled_from([Perspective, Orthographic]),
    direction=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda d: np.linalg.norm(d) > 0.1),
    aspect=st.floats(0.3, 3),
    size=st.sampled_from([1e-6, 1.0, 1e6]),
    away=st.sampled_from([0.0, 100.0]),
    seed=st.integers(0, 99),
)
def test_framed_points_are_inside_and_fill_the_picture(
    shape, projection, direction, aspect, size, away, seed
):
    random = np.random.default_rng(seed)
    points = size * (random.normal(size=(50, 3)) * SHAPES[shape] + away * random.normal(size=3))
    words = {"projection": "orthographic"} if projection is Orthographic else {"fov": 40.0}
    camera = projection(position=direction, target=(0.0, 0.0, 0.0), fit="thing", **words)
    made = framing(camera, aspect, points)
    places, depth = in_picture(made, aspect, points)
    assert (depth > 0).all()
    radius = np.linalg.norm(points - (points.min(axis=0) + points.max(axis=0)) / 2, axis=1).max()
    if (
        depth.min() > 1.001 * CLOSEST * radius
    ):  # else the eye stands right before a point, as before a needle's tip
        assert np.abs(places).max() == pytest.approx(1 - MARGIN, rel=1e-6)
    assert np.abs(places.min(axis=1) + places.max(axis=1)).max() < 1e-6  # as far to either side
    np.testing.assert_allclose(axes(made)[2], axes(camera)[2], atol=1e-9)
    assert made.fit is None


@pytest.mark.parametrize("words", [{}, {"projection": "orthographic"}])
def test_a_point_and_a_line_along_the_view_can_be_framed(words):
    kind = Orthographic if words else Perspective
    camera = kind(position=(0.0, 0.0, 1.0), target=(0.0, 0.0, 0.0), **words)
    for points in ([[1.0, 2, 3]], [[1.0, 2, 3], [1, 2, 4]]):
        made = framing(camera, 1.5, np.array(points))
        places, depth = in_picture(made, 1.5, np.array(points))
        assert (depth > 0).all()
        assert np.abs(places).max() < 1e-9
