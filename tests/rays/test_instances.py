"""Instances: rays meet them as they meet copies, and none meets the surface that it leaves."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.arrays import F, column_major, cross, unit
from illumcli.geometry import instances
from illumcli.geometry.bounds import object_bounds
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.scene_geometry import place_meshes, scene_geometry
from illumcli.geometry.shapes.box import Box
from illumcli.rays import embree, packet_loop
from illumcli.rays.embree import tracer
from illumcli.rays.embree_library import embree_library
from illumcli.rays.embree_tree import native_widths
from illumcli.rays.interaction import interact
from illumcli.rays.offsets import offset_ray_origins
from illumcli.rays.packet_loop import PacketLoop
from illumcli.rays.pattern_rays import PatternRays, PatternResults, Patterns
from illumcli.rays.python_packet_loop import PythonPacketLoop
from illumcli.stress.rays import grazing, icosphere

pytestmark = pytest.mark.skipif(embree_library() is None, reason="embreex without its library")

BALL = icosphere(4)
NEEDLE = Mesh.of_triangles(BALL.vertices * [1, 1e-3, 1e-3], BALL.corners)
BODIES = {"box": Box().mesh(), "ball": BALL, "needle": NEEDLE}
COPIES = 8


def turned(random: np.random.Generator) -> np.ndarray:
    q, _ = np.linalg.qr(random.normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def matrices_of(random, count, stretch, size, centre=(0.0, 0.0, 0.0)):
    """Rotated, sheared and mirrored, with axes of `size` at most, at random places."""
    out = []
    for _ in range(count):
        axes = np.array([1, stretch ** random.uniform(-1, 0), 1 / stretch])
        matrix = np.eye(4)
        matrix[:3, :3] = turned(random) @ np.diag(random.permutation(axes)) @ turned(random) * size
        matrix[:3, :3] *= random.uniform(0.3, 1)
        if random.random() < 0.5:
            matrix[:3, 0] *= -1
        matrix[:3, 3] = random.normal(size=3) / 2 - matrix[:3, :3] @ centre
        out.append(matrix)
    return out


def copies(mesh, matrices, shared=True):
    """One mesh under each matrix, and two specks that hold the scene's frame."""
    specks = Mesh.of_triangles(
        np.repeat([[-2.0] * 3, [2.0] * 3], 3, axis=0) + np.tile(np.eye(3) / 1e3, (2, 1)),
        [[0, 1, 2], [3, 4, 5]],
    )
    meshes, matrices = [*[mesh] * len(matrices), specks], [*matrices, np.eye(4)]
    if not shared:
        return place_meshes(meshes, matrices)
    kinds = [0] * (len(meshes) - 1) + [1]
    return scene_geometry([True] * len(meshes), kinds, meshes, object_bounds(meshes, matrices))


def leaving(geometry, random, count):
    """Rays that leave random instances, many of them from edges and close to the surface: their objects,
    origins and directions."""
    objects = random.integers(0, COPIES, count).astype(np.int32)
    starts = np.array([*(each.first_triangle for each in geometry.placed), len(geometry.triangles)])
    which = geometry.placed_mesh[objects]
    triangle = (starts[which] + random.random(count) * (starts[which + 1] - starts[which])).astype(np.int32)
    u, v = random.random((2, count)).astype(F)
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    u[: count // 4], v[: count // 8] = 0, random.integers(0, 2, count // 8)
    a, b, c = (geometry.corner_positions(objects, triangle, k) for k in range(3))
    outward = unit(column_major(cross(b - a, c - a)))
    hit = interact(geometry, objects, triangle, u, v, outward)
    origins = offset_ray_origins(hit.position, hit.ng, hit.edge)
    return objects, origins, grazing(hit.ng, int(random.integers(1 << 30)))


def self_hits(mesh, stretch, size, seed, count=60_000, centre=(0.0, 0.0, 0.0)):
    random = np.random.default_rng(seed)
    geometry = copies(mesh, matrices_of(random, COPIES, stretch, size, centre))
    assert len(geometry.instances.object) == COPIES
    objects, origins, directions = leaving(geometry, random, count)
    hit = tracer(geometry).closest(origins, directions)
    again = (hit.triangle >= 0) & (geometry.objects_of(hit.triangle, hit.instance) == objects)
    return int(np.count_nonzero(again))


@pytest.mark.parametrize("size", [1, 1e-1, 1e-3])
@pytest.mark.parametrize("stretch", [1, 3])
@pytest.mark.parametrize("name", BODIES)
def test_no_ray_hits_the_convex_instance_that_it_leaves(name, stretch, size):
    assert self_hits(BODIES[name], stretch, size, 7) == 0


def test_nor_if_the_mesh_lies_far_from_its_origin():
    centre = np.array([30.0, -9.0, 17.0])
    away = Mesh(BALL.vertices + centre, BALL.corners, BALL.starts)
    assert self_hits(away, 3, 0.3, 8, centre=centre) == 0


def test_smaller_offsets_or_longer_axes_would_hit_it(monkeypatch):
    monkeypatch.setattr(instances, "MOST_STRETCH", 40.0)
    assert self_hits(BALL, 30, 0.1, 7) > 0
    monkeypatch.setattr(instances, "REACH", 0.0)
    assert self_hits(BODIES["box"], 1, 1, 7) > 0


@pytest.fixture(scope="module")
def scene():
    """A geometry with instances, what its trees are built from, and rays towards them."""
    random = np.random.default_rng(3)
    geometry = copies(icosphere(2), matrices_of(random, COPIES, 2.5, 0.5))
    built = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(embree, "Tracer", lambda *parts: built.append(parts))
        tracer(geometry)
    origins = column_major(unit(random.normal(size=(999, 3))) * 1.2, F)
    centres = geometry.instances.matrix[random.integers(0, COPIES, 999), :, 3]
    directions = column_major(unit(centres + random.normal(size=(999, 3)) / 12 - origins), F)
    return geometry, built[0], origins, directions


@pytest.fixture(scope="module")
def loops(scene):
    _, built, *_ = scene
    loops = [PythonPacketLoop(*built)]
    if packet_loop.missing() is None:
        widths = (1, *native_widths())
        loops += [PacketLoop(*built[:2], width, built[2]) for width in widths]
    return loops


def test_all_loops_give_the_same_bits(scene, loops):
    _, _, origins, directions = scene
    first, *others = loops
    limits = np.linspace(0.1, 2.5, len(origins), dtype=F)
    closest, hidden = first.closest(origins, directions), first.occluded(origins, directions, limits)
    assert (closest.instance >= 0).mean() > 0.3
    assert 0.1 < hidden.mean() < 0.9
    for loop in others:
        same = loop.closest(origins, directions)
        hit = closest.triangle >= 0
        assert np.array_equal(same.triangle, closest.triangle)
        assert np.array_equal(same.instance, closest.instance)
        assert np.array_equal(same.distance, closest.distance)
        assert np.array_equal(same.u[hit], closest.u[hit])
        assert np.array_equal(same.v[hit], closest.v[hit])
        assert np.array_equal(loop.distance(origins, directions), first.distance(origins, directions))
        for coherent in (False, True):
            assert np.array_equal(loop.occluded(origins, directions, limits, coherent), hidden)
            assert np.array_equal(loop.occluded(origins[:1], directions, limits, coherent),
                                  first.occluded(origins[:1], directions, limits))  # fmt: skip


def test_all_loops_trace_the_same_patterns(scene, loops):
    _, _, origins, _ = scene
    random = np.random.default_rng(1)
    points, samples = 37, 21
    table = np.ascontiguousarray(unit(random.normal(size=(samples, 3))).T[None], F)
    frames = np.stack([turned(random) for _ in range(points)]).astype(F)
    rays = PatternRays(
        Patterns(table, np.zeros(points, np.int32)), frames, column_major(origins[:points]),
        np.zeros(samples, np.int32), None, np.full(points, samples, np.int32), 1e-6,
    )  # fmt: skip
    results = []
    for loop in loops:
        open_, far = (PatternResults.room(rays.shape, *wanted) for wanted in (["is_open"], ["distance"]))
        loop.trace_patterns(rays, 1.5, open_)
        loop.trace_patterns(rays, 1e37, far)
        results.append((open_.open, open_.is_open, far.distance))
    assert 0 < results[0][1].mean() < 1
    for other in results[1:]:
        assert all(np.array_equal(a, b) for a, b in zip(results[0], other, strict=True))


def test_instances_are_hit_where_copies_are(scene):
    random = np.random.default_rng(3)
    geometry, _, origins, directions = scene
    flat = copies(icosphere(2), matrices_of(random, COPIES, 2.5, 0.5), shared=False)
    a, b = tracer(geometry).closest(origins, directions), tracer(flat).closest(origins, directions)
    hit = a.triangle >= 0
    assert np.array_equal(hit, b.triangle >= 0)
    objects = geometry.objects_of(a.triangle[hit], a.instance[hit])
    assert np.array_equal(objects, flat.objects[b.triangle[hit]])
    numbers = geometry.triangle_numbers(objects, a.triangle[hit])
    assert (numbers == b.triangle[hit]).mean() > 0.99
    np.testing.assert_allclose(a.distance[hit], b.distance[hit], rtol=3e-6)


def test_rays_that_miss_or_meet_no_instance_have_none(scene):
    geometry, *_ = scene
    o, d = np.array([[3, 0, 0], [0.9, 0.9, 2]], F), np.array([[1, 0, 0], [0, 0, 1]], F)
    hit = tracer(geometry).closest(column_major(o), column_major(d))
    assert hit.triangle.tolist() == hit.instance.tolist() == [-1, -1]
