"""Points with no geometry above them, compared with a test of every vertex."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.scene_geometry import place_meshes
from illumcli.geometry.shapes.sphere import Sphere
from illumcli.geometry.shapes.torus import Torus
from illumcli.geometry.spatial_order import compact
from illumcli.rays.offsets import offset_ray_origins
from illumcli.visibility.open_hemisphere import ClusterTree, OpenTriangles

F = np.float32


def ball(count, seed=0):
    """Points on the unit sphere; triangles only say that they are used."""
    p = np.random.default_rng(seed).normal(size=(count, 3))
    p = (p / np.linalg.norm(p, axis=1, keepdims=True)).astype(F)
    return p, np.arange(count - count % 3, dtype=np.int32).reshape(-1, 3)


def raised(p, n):
    return offset_ray_origins(np.asarray(p, float), n.astype(F), np.full(len(p), 0.01))


def by_all(vertices, origins, n):
    height = np.einsum("ij,ij->i", origins.astype(float), n.astype(float))
    return (n.astype(float) @ vertices.astype(float).T).max(axis=1) <= height


def is_open(tree, origins, n):
    return tree.is_open(len(origins), lambda index: (origins[index], n[index]))


@pytest.mark.parametrize("count", [3, 9, 100, 3000, 20001])
def test_every_point_of_a_ball_is_clear(count):
    p, t = ball(count)
    p = p[: t.size]
    assert is_open(ClusterTree(p, t), raised(p, p), p).all()


def test_agrees_with_a_look_at_every_vertex():
    p, t = ball(3000)
    p = p * (1 + 0.05 * np.sin(9 * p[:, :1])).astype(F)
    n = p / np.linalg.norm(p, axis=1, keepdims=True)
    order = compact(p)
    o, n = raised(p, n)[order], n[order]
    opened, truth = is_open(ClusterTree(p, t), o, n), by_all(p, o, n)
    assert 0.02 < truth.mean() < 0.98
    assert np.array_equal(opened, truth)


def test_a_vertex_just_above_is_found_and_one_that_no_triangle_uses_is_not():
    p, t = ball(3000)
    p[-1] = p[0] * F(1.0001)
    n = p[:1] / np.linalg.norm(p[:1])
    assert not is_open(ClusterTree(p, t), raised(p[:1], n), n)[0]
    assert is_open(ClusterTree(p, t[:-1]), raised(p[:1], n), n)[0]


def test_nothing_at_all_hides_nothing():
    empty = ClusterTree(np.zeros((0, 3), F), np.zeros((0, 3), np.int32))
    assert is_open(empty, np.zeros((2, 3), F), np.eye(3, dtype=F)[:2]).all()


def test_an_order_holds_every_point_once_and_rows_are_near():
    p = np.random.default_rng(3).random((10007, 3))
    order = compact(p)
    assert np.array_equal(np.sort(order), np.arange(len(p)))
    rows = p[order[:8000]].reshape(-1, 8, 3)
    assert np.ptp(rows, axis=1).max(axis=1).mean() < 0.15
    assert compact(np.zeros((5, 3))).tolist() == [0, 1, 2, 3, 4]


def test_points_of_a_hollow_settle_each_other_without_the_tree(monkeypatch):
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(-1, 1, 30), np.linspace(-1, 1, 30)))
    p = np.stack([x, y, 0.2 * (x * x + y * y)], axis=1).astype(F)
    n = np.stack([-0.4 * x, -0.4 * y, np.ones_like(x)], axis=1)
    n = (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(F)
    t = np.arange(900, dtype=np.int32).reshape(-1, 3)
    order = compact(p)
    monkeypatch.setattr(ClusterTree, "_tree", lambda self: pytest.fail("the tree was asked"))
    monkeypatch.setattr("illumcli.visibility.open_hemisphere.extremes", lambda points: points[:1])
    assert not is_open(ClusterTree(p, t), raised(p, n)[order], n[order]).any()


@pytest.mark.parametrize(("down", "built"), [(50, True), (2000, False)])
def test_the_tree_is_built_for_many_points_only(down, built):
    p, t = ball(3000)
    inward = -p[:down] / np.linalg.norm(p[:down], axis=1, keepdims=True)  # all of the ball is above these
    o, n = np.concatenate([raised(p[:1], p[:1]), raised(p[:down], inward)]), np.concatenate([p[:1], inward])
    tree = ClusterTree(p, t)
    assert is_open(tree, np.asfortranarray(o), n).tolist() == [built] + [False] * down
    assert (tree._levels is not None) == built


def world_of(*meshes):
    return place_meshes(list(meshes), [np.eye(4)] * len(meshes))


def test_every_facet_of_a_convex_mesh_is_open_in_front_and_none_behind():
    geometry = world_of(Sphere(shape="sphere").mesh())
    triangle = np.repeat(np.arange(len(geometry.triangles), dtype=np.int32), 2)
    front = np.tile([False, True], len(geometry.triangles))
    opened = OpenTriangles(geometry).is_open(triangle, front, 1)
    assert opened[~front].all()
    assert not opened[front].any()


def test_facets_that_few_samples_lie_on_are_not_looked_at():
    geometry = world_of(Sphere(shape="sphere").mesh())
    triangle = np.arange(len(geometry.triangles), dtype=np.int32)[:70]
    opened = OpenTriangles(geometry).is_open(triangle, np.zeros(70, bool), 10)
    assert opened.tolist() == [True] * 64 + [False] * 6


def test_a_world_without_open_facets_is_not_looked_through(monkeypatch):
    y, x = (each.ravel() for each in np.mgrid[-1:1:40j, -1:1:40j])
    corner = (np.arange(39)[:, None] * 40 + np.arange(39)).reshape(-1, 1)
    halves = [corner + np.array(half) for half in ((0, 1, 41), (0, 41, 40))]
    saddle = Mesh.of_triangles(np.stack([x, y, x * y], axis=1), np.concatenate(halves))
    monkeypatch.setattr(OpenTriangles, "_test", lambda self, groups: pytest.fail("a group was tested"))
    triangle = np.arange(2 * len(corner), dtype=np.int32)
    for back_facing in (False, True):
        assert (
            not OpenTriangles(world_of(saddle))
            .is_open(triangle, np.full(len(triangle), back_facing), 1)
            .any()
        )


def test_an_open_facet_does_not_depend_on_who_asks_first():
    geometry = world_of(Torus(shape="torus").mesh(), Sphere(shape="sphere").mesh())
    triangle = np.arange(len(geometry.triangles), dtype=np.int32)
    back_facing = np.zeros(len(triangle), bool)
    whole = OpenTriangles(geometry).is_open(triangle, back_facing, 1)
    parts = OpenTriangles(geometry)
    for part in np.array_split(np.random.default_rng(1).permutation(len(triangle)), 50):
        assert np.array_equal(parts.is_open(triangle[part], back_facing[part], 1), whole[part])


def test_open_facets_are_open_to_every_vertex():
    geometry = world_of(Torus(shape="torus").mesh())
    triangle = np.arange(len(geometry.triangles), dtype=np.int32)
    opened = OpenTriangles(geometry).is_open(triangle, np.zeros(len(triangle), bool), 1)
    corner = geometry.vertices[geometry.triangles[:, 0]].astype(float)
    sides = [geometry.vertices[geometry.triangles[:, k]].astype(float) - corner for k in (1, 2)]
    n = np.cross(*sides)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    above = (n @ geometry.vertices.astype(float).T).max(axis=1) - np.einsum("ij,ij->i", n, corner)
    assert 0.3 < opened.mean() < 0.7
    assert (above[opened] < 1e-6).all()
    assert (above[~opened] > 1e-6).mean() > 0.9
