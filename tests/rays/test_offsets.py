"""Offsets: no false self-hit on convex bodies, and contact gaps still shade."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.geometry.mesh import Mesh
from illumcli.rays.embree import Tracer
from illumcli.rays.offsets import bounded, offset_ray_origins, to_tangent_plane
from illumcli.stress.rays import grazing, icosphere, surface_points, world_of

F = np.float32


def outward_points(vertices, faces, count, rng):
    """Float64 points on faces, a quarter on edges and some at vertices; normals, longest edges."""
    v = vertices.astype(F).astype(float)
    k = rng.integers(0, len(faces), count)
    weights = rng.dirichlet((1, 1, 1), count)
    weights[: count // 4, 0] = 0
    weights[: count // 16, 1] = 0
    weights /= weights.sum(axis=1, keepdims=True)
    corners = v[faces[k]]
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    n = np.cross(e1, e2)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    n *= np.sign(((corners.mean(axis=1) - v.mean(axis=0)) * n).sum(axis=1))[:, None]
    edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    return (weights[:, :, None] * corners).sum(axis=1), n, edge


def leaving(n, rng):
    """Directions in the open hemispheres about n, half of them grazing down to a micro-radian."""
    count = len(n)
    cosine = np.sqrt(1 - rng.random(count))
    cosine[::2] *= 10.0 ** rng.uniform(-6, 0, len(cosine[::2]))
    t = np.cross(n, np.where(np.abs(n[:, :1]) < 0.6, [[1.0, 0, 0]], [[0, 1.0, 0]]))
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    angle, sine = 2 * np.pi * rng.random(count), np.sqrt(1 - cosine**2)
    return (
        (sine * np.cos(angle))[:, None] * t
        + (sine * np.sin(angle))[:, None] * np.cross(n, t)
        + cosine[:, None] * n
    )


def false_hits(bodies, rays_per_body):
    rng = np.random.default_rng(7)
    hits = 0
    for vertices, faces in bodies.values():
        tracer = Tracer(vertices.astype(F), faces)
        p, n, edge = outward_points(vertices, faces, 20_000, rng)
        origins = offset_ray_origins(p, n.astype(F), edge.astype(F)).astype(F)
        for _ in range(rays_per_body // len(p)):
            hits += int(np.count_nonzero(tracer.occluded(origins, leaving(n, rng).astype(F))))
    return hits


def test_no_ray_that_leaves_a_convex_body_hits_it(bodies):
    assert false_hits(bodies, 100_000) == 0


@pytest.mark.slow
def test_no_ray_of_ten_million_that_leaves_a_convex_body_hits_it(bodies):
    assert false_hits(bodies, 2_000_000) == 0


@pytest.mark.parametrize("height", [0.0, 0.7])
def test_a_plate_a_millionth_above_the_floor_still_shades_it(height):
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    vertices = np.concatenate([square + np.array([0, 0, z]) for z in (height, height + 1e-6)]).astype(F)
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]], np.int32)
    rng = np.random.default_rng(3)
    p = np.column_stack([rng.uniform(-0.9, 0.9, (4000, 2)), np.full(4000, float(F(height)))])
    n = np.tile(F([0, 0, 1]), (4000, 1))
    d = rng.normal(size=(4000, 3))
    d[:, 2] = np.abs(d[:, 2]) + 0.05
    origins = offset_ray_origins(p, n, np.full(4000, F(2.83))).astype(F)
    assert Tracer(vertices, faces).occluded(origins, d.astype(F)).all()


def test_the_mean_way_to_the_tangent_planes_reaches_the_sphere_and_leaves_hollows_alone(ball):
    vertices, faces = ball
    corners = tuple(np.asfortranarray(vertices[faces[:, k]]) for k in range(3))
    centre = np.mean(corners, axis=0)
    lift = 1 / 3 * sum(to_tangent_plane(centre, corner, corner) for corner in corners)
    assert (np.linalg.norm(centre + lift, axis=1) >= 1).all()
    for corner in corners:
        assert not to_tangent_plane(centre, corner, -corner).any()


def test_a_way_is_shortened_to_its_bound_and_never_lengthened():
    way = np.asfortranarray([[0.0, 3, 4], [0, 0.3, 0.4], [0, 0, 0]])
    short = bounded(way, np.array([1.0, 1, 1]))
    np.testing.assert_allclose(short, [[0, 0.6, 0.8], [0, 0.3, 0.4], [0, 0, 0]])


def test_a_needle_turned_out_of_its_axes_does_not_hit_itself():
    ball = icosphere(5)
    geometry = world_of(Mesh.of_triangles(ball.vertices * [1, 1e-3, 1e-3], ball.corners))
    tracer = Tracer(geometry.vertices, geometry.triangles)
    position, interaction = surface_points(geometry, 50_000, seed=0)
    up = grazing(interaction.ng.astype(float), seed=0)
    assert not tracer.occluded(offset_ray_origins(position, interaction.ng, interaction.edge), up).any()
