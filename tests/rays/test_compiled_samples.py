"""The compiled loop gives the bits of numpy: camera rays, positions, normals and edges."""

from __future__ import annotations

import numpy as np
import pytest

from conftest import needs_loop
from illumcli.compiled import SWITCH
from illumcli.geometry.corner_normals import corner_normals
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.scene_geometry import CornerVectors, place_meshes, scene_normals
from illumcli.geometry.shapes.sphere import Sphere
from illumcli.rays.camera import camera_rays
from illumcli.rays.compiled_samples import sample_loop
from illumcli.rays.corner_weights import CornerWeights, TriangleCorners
from illumcli.rays.interaction import ShadingContext, interact, interpolated
from illumcli.rays.offsets import offset_ray_origins
from illumcli.render_space import RenderSpace
from illumcli.scene.spec import Perspective

F = np.float32


@pytest.fixture(autouse=True)
def _needs_the_loop(monkeypatch):
    needs_loop(sample_loop, monkeypatch)


def same_bits(first, second):
    for name, values in vars(first).items():
        other = getattr(second, name)
        assert (values.dtype, values.shape) == (other.dtype, other.shape), name
        assert np.ascontiguousarray(values).tobytes() == np.ascontiguousarray(other).tobytes(), name


@pytest.mark.parametrize("distance", [0.0, 1.2, 3.0, 1e6])
def test_camera_rays_have_the_same_bits(monkeypatch, distance):
    space = RenderSpace((0.3, -0.1, 7.0), 2.5)
    eye = space.to_world(distance * np.array([0.48, 0.6, 0.64]))
    camera = Perspective(position=tuple(eye), target=(0.1, 0.2, -0.3), fov=47.0)
    points = np.random.default_rng(5).random((5000, 2)) * (200, 70)
    compiled = camera_rays(camera, space, 192, 64, points)
    monkeypatch.setenv(SWITCH, "0")
    same_bits(compiled, camera_rays(camera, space, 192, 64, points))


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e4])
def test_surfaces_have_the_same_bits(monkeypatch, scale):
    rng = np.random.default_rng(6)
    vertices = rng.normal(size=(400, 3, 3)) * rng.gamma(0.3, size=(400, 1, 1))
    vertices[::7, 2] = 0.5 * vertices[::7, 0] + 0.5 * vertices[::7, 1] + 1e-6  # slivers
    vertices[3::7, 2] = vertices[3::7, 1]  # no area
    corners = np.arange(1200, dtype=np.int32)
    mesh = Mesh(vertices.reshape(-1, 3), corners, np.arange(0, 1201, 3, np.int32))
    geometry = place_meshes([mesh], [np.diag([scale, scale, -scale, 1.0])])
    triangle = rng.integers(0, len(geometry.triangles), 20_000).astype(np.int32)
    u, v = rng.random((2, len(triangle))).astype(F) / F(2)
    towards_eye = rng.normal(size=(len(triangle), 3)).astype(F)
    arguments = geometry, np.zeros_like(triangle), triangle, u, v, towards_eye
    compiled = interact(*arguments)
    monkeypatch.setenv(SWITCH, "0")
    same_bits(compiled, interact(*arguments))
    assert compiled.back_facing.any()


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_ray_origins_have_the_same_bits(monkeypatch, scale):
    rng = np.random.default_rng(7)
    position = np.asfortranarray(scale * rng.normal(size=(5001, 3)))
    position[::5, 1], position[::7, 0] = 0, -0.0
    ng = np.asfortranarray(rng.normal(size=(5001, 3)).astype(F))
    ng[::3, 2], ng[::4, 1] = 0, -0.0
    edges = rng.random(5001).astype(F)
    for arguments in ((position, ng, edges), (position, ng, edges.astype(float)), (position, ng[:1], edges)):
        monkeypatch.delenv(SWITCH, raising=False)
        compiled = offset_ray_origins(*arguments)
        monkeypatch.setenv(SWITCH, "0")
        assert compiled.tobytes() == offset_ray_origins(*arguments).tobytes()


def test_interpolated_normals_have_the_same_bits(monkeypatch):
    rng = np.random.default_rng(7)
    ball = Sphere(segments=12, rings=7).mesh()
    geometry = place_meshes([ball], [np.diag([1.0, 2.0, -1.0, 1.0])])
    normals = scene_normals(geometry, [corner_normals(ball)])
    values = normals.values.copy()
    values[::5] *= -1  # some vanish between opposite corners
    normals = CornerVectors(values, normals.index)
    triangle = rng.integers(0, len(geometry.triangles), 5000).astype(np.int32)
    u, v = np.sort(rng.random((2, len(triangle))), axis=0).astype(F)
    u, v = u, v - u
    u[::3], v[::3] = 0.5, 0.5
    objects = np.zeros_like(triangle)
    surface = interact(geometry, objects, triangle, u, v, rng.normal(size=(len(triangle), 3)).astype(F))
    weights = TriangleCorners(None, objects, triangle, u, v)
    context = ShadingContext(geometry, CornerWeights(weights, (weights,)), surface, normals)
    compiled = interpolated(context)
    monkeypatch.setenv(SWITCH, "0")
    assert np.asfortranarray(compiled).tobytes("F") == np.asfortranarray(interpolated(context)).tobytes("F")
    assert (compiled == surface.ng).all(axis=1).any()


def test_other_types_are_computed_by_numpy(monkeypatch):
    corners = np.arange(3, dtype=np.int32)
    geometry = place_meshes([Mesh(np.eye(3), corners, np.array([0, 3], np.int32))], [np.eye(4)])
    at = np.array([[0.3], [0.1]])
    arguments = geometry, np.zeros(1, np.int32), np.zeros(1, np.int64), *at, np.ones((1, 3))
    compiled = interact(*arguments)
    monkeypatch.setenv(SWITCH, "0")
    same_bits(compiled, interact(*arguments))
