"""Tangent frames: along u, along rings about an axis, and the default if neither is known."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.arrays import column_major, dot, length
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.scene_geometry import place_meshes, scene_uvs
from illumcli.geometry.shapes.cylinder import Cylinder
from illumcli.geometry.shapes.plane import Plane
from illumcli.geometry.shapes.sphere import Sphere
from illumcli.geometry.transforms import rotation
from illumcli.rays.corner_weights import TriangleCorners, corner_weights
from illumcli.rays.interaction import rings, tangent, uv_tangents

F = np.float32
SKEWED = rotation(0, 30) @ np.diag([2.0, 0.5, 1.0, 1.0]) @ rotation(2, 50)
MIRRORED = np.diag([-1.0, 1.0, 3.0, 1.0])


def anywhere(geometry, count=2000, seed=3):
    random = np.random.default_rng(seed)
    triangle = random.integers(0, len(geometry.triangles), count).astype(np.int32)
    a, b = np.sort(random.random((2, count)), axis=0)
    return triangle, a.astype(F), (b - a).astype(F)


def position(geometry, triangle, u, v):
    p0, p1, p2 = (geometry.vertices[geometry.triangles[triangle, k]].astype(float) for k in range(3))
    return (1 - u - v)[:, None] * p0 + u[:, None] * p1 + v[:, None] * p2


def along_u(geometry, triangle, u, v):
    weights = corner_weights(geometry, TriangleCorners(None, geometry.objects[triangle], triangle, u, v))
    return weights.interpolate(geometry, uv_tangents(geometry, scene_uvs(geometry)))


def unit_rows(x):
    return x / np.linalg.norm(x, axis=1, keepdims=True)


@pytest.mark.parametrize("matrix", [np.eye(4), SKEWED, MIRRORED], ids=["plain", "skewed", "mirrored"])
def test_u_grows_along_x_of_a_plane_under_any_transform(matrix):
    geometry = place_meshes([Plane(resolution=(3, 2)).mesh()], [matrix])
    at = anywhere(geometry)
    found = along_u(geometry, *at)
    wanted = matrix[:3, 0] / np.linalg.norm(matrix[:3, 0])
    np.testing.assert_allclose(found, np.tile(wanted, (len(found), 1)), atol=1e-5)


@pytest.mark.parametrize("shape", [Cylinder(segments=16, caps=False), Sphere(segments=16, rings=24)])
def test_the_grain_of_a_coarse_round_body_is_smooth(shape):
    geometry = place_meshes([shape.mesh()], [np.eye(4)])
    triangle, u, v = anywhere(geometry)
    p = position(geometry, triangle, u, v)
    seam = (p[:, 0] > 0) & (np.abs(p[:, 2]) < np.tan(2 * np.pi / 16) * p[:, 0])
    keep = (np.hypot(p[:, 0], p[:, 2]) > 0.2) & ~seam
    found = unit_rows(along_u(geometry, triangle, u, v))[keep]
    wanted = unit_rows(np.cross([0, 1, 0], p))[keep]
    assert np.degrees(np.arccos(np.clip(dot(found, wanted), -1, 1))).max() < 2  # a facet spans 22.5


def test_uv_that_turn_over_at_a_seam_keep_their_sides_apart():
    # two triangles share an edge and its uv; u grows to the right on one, to the left on the other
    mesh = Mesh.of_triangles(
        [[0, 0, 0], [0, 1, 0], [1, 0, 0], [-1, 0, 0]],
        [[0, 2, 1], [0, 1, 3]],
        uvs=np.array([[0, 0], [0, 1], [1, 0]], float),
        corner_uvs=np.array([[0, 2, 1], [0, 1, 2]], np.int32),
    )
    geometry = place_meshes([mesh], [np.eye(4)])
    third = np.full(2, 1 / 3, F)
    found = along_u(geometry, np.array([0, 1], np.int32), third, third)
    np.testing.assert_allclose(found, [[1, 0, 0], [-1, 0, 0]], atol=1e-6)


def test_no_uv_or_flat_uv_give_no_direction():
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    bare = Mesh.of_triangles(corners, [[0, 1, 2]])
    flat = Mesh.of_triangles(corners, [[0, 1, 2]], uvs=np.ones((1, 2)), corner_uvs=np.zeros((1, 3), np.int32))
    for mesh in (bare, flat):
        geometry = place_meshes([mesh], [np.eye(4)])
        assert not uv_tangents(geometry, scene_uvs(geometry)).values.any()


@pytest.mark.parametrize("matrix", [np.eye(4), SKEWED, MIRRORED], ids=["plain", "skewed", "mirrored"])
def test_rings_are_the_way_a_point_takes_when_the_object_turns(matrix):
    random = np.random.default_rng(1)
    axis, centre = np.array([0.3, 1.0, -0.2]), np.array([0.1, 0.2, 0.3])
    own = random.normal(size=(50, 3))
    turned = own + 1e-6 * np.cross(axis, own - centre)
    linear = matrix[:3, :3]
    wanted = unit_rows((turned - own) @ linear.T)
    found = rings(linear, axis, linear @ centre, column_major(own @ linear.T))
    np.testing.assert_allclose(found, wanted, atol=1e-8)


def test_on_the_axis_there_is_no_ring():
    assert not rings(np.eye(3), (0, 1, 0), (0, 0, 0), np.array([[0.0, 2.0, 0.0]])).any()


def test_tangents_stand_on_the_normal_whatever_the_grain():
    random = np.random.default_rng(2)
    n = column_major(unit_rows(random.normal(size=(300, 3))), F)
    grain = column_major(unit_rows(random.normal(size=(300, 3))), F)
    grain[:100] = n[:100] * random.choice([-1, 1], 100)[:, None]
    grain[100:200] = 0
    t = tangent(n, grain)
    np.testing.assert_allclose(length(t), 1, atol=1e-6)
    np.testing.assert_allclose(dot(t, n), 0, atol=1e-6)
    assert (dot(t, grain)[200:] > 0).all()
    np.testing.assert_array_equal(tangent(-n, grain)[200:], t[200:])  # the back of a face has the same grain
