"""Patterns of rays: rotated and mirrored in C as in numpy, bit for bit, and traced like any other rays."""

from __future__ import annotations

import os

import numpy as np
import pytest

from illumcli.errors import IllumError
from illumcli.rays.embree import Tracer
from illumcli.rays.packet_loop import PacketLoop, missing, native_widths
from illumcli.rays.pattern_rays import PatternRays, PatternResults, Patterns
from illumcli.rays.ray_loop import NO_LIMIT
from illumcli.rays.sampling import compact_spiral_table, spiral_table
from illumcli.rays.single_ray_loop import SingleRayLoop

F = np.float32
LEAST = 0.02
LONGEST = float(NO_LIMIT)


@pytest.fixture(scope="module")
def scene(ball):
    """Two overlapping balls, and the loops over them; single rays first."""
    vertices, faces = ball
    both = np.concatenate([vertices, vertices * 0.6 + [0.9, 0.2, 0]]).astype(F)
    triangles = np.concatenate([faces, faces + len(vertices)])
    if (why := missing()) is not None:
        assert os.environ.get("ILLUM_REQUIRE_PACKETS") != "1", why
        pytest.skip(why)
    widths = {w: PacketLoop(both, triangles, w) for w in (1, *native_widths())}
    return both, triangles, SingleRayLoop(both, triangles), widths


def orthonormal(rng, count):
    return np.ascontiguousarray(np.linalg.qr(rng.normal(size=(count, 3, 3)))[0].astype(F))


def pattern_rays(scene, points, samples, each=1, mirrored=True, compact=True, seed=0):
    """Rays off the balls, about axes tilted against the triangles."""
    vertices, triangles, *_ = scene
    rng = np.random.default_rng(seed)
    table = spiral_table(samples)
    corners = vertices[triangles[rng.integers(0, len(triangles), points * each)]].astype(float)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    origins = corners.mean(axis=1) + 1e-5 * normal
    return PatternRays(
        Patterns(
            table,
            rng.integers(0, len(table), points).astype(np.int32),
            compact_spiral_table(samples) if compact else None,
        ),
        orthonormal(rng, points),
        np.asfortranarray(origins.astype(F)),
        (np.arange(samples) * 13 % each).astype(np.int32),
        np.asfortranarray(normal.astype(F)) if mirrored else None,
        rng.integers(0, samples + 1, points).astype(np.int32),
        LEAST,
    )


def traced(loop, rays, *wanted, limit=LONGEST):
    out = PatternResults.room(rays.shape, *wanted)
    loop.trace_patterns(rays, limit, out)
    return out


def assert_same(loop, single, rays, limit=LONGEST):
    expected = traced(single, rays, "is_open", "directions", limit=limit)
    found = traced(loop, rays, "is_open", "directions", limit=limit)
    assert found.directions.tobytes() == expected.directions.tobytes()
    assert np.array_equal(found.is_open, expected.is_open)
    assert np.array_equal(found.open, expected.open)
    assert np.array_equal(found.open, found.is_open.sum(axis=1))
    assert np.array_equal(traced(loop, rays, limit=limit).open, expected.open)
    expected = traced(single, rays, "distance", "directions")
    found = traced(loop, rays, "distance", "directions")
    assert found.distance.tobytes() == expected.distance.tobytes()
    assert found.directions.tobytes() == expected.directions.tobytes()


@pytest.mark.parametrize("samples", [1, 3, 5, 8, 16, 17, 40, 64, 100])
@pytest.mark.parametrize("each", [1, 3, 16])
def test_packets_give_the_bits_of_numpy_and_single_rays(scene, samples, each):
    *_, single, widths = scene
    for compact in (True, False):
        for mirrored in (True, False):
            rays = pattern_rays(scene, 61, samples, each, mirrored, compact)
            assert 0.02 < 1 - traced(single, rays).open.mean() / samples < 0.98
            for loop in widths.values():
                assert_same(loop, single, rays)
                assert_same(loop, single, rays, limit=0.3)


@pytest.mark.parametrize("points", [pytest.param(200_000, marks=pytest.mark.slow), 2000])
def test_many_rays_have_the_same_bits(scene, points):
    *_, single, widths = scene
    rays = pattern_rays(scene, points, 64)
    for loop in widths.values():
        assert_same(loop, single, rays)


def test_results_do_not_depend_on_the_split_into_calls(scene, monkeypatch):
    *_, single, widths = scene
    rays = pattern_rays(scene, 61, 20, 3)
    monkeypatch.setattr("illumcli.rays.packet_loop.RAYS_PER_CALL", 150)
    monkeypatch.setattr("illumcli.rays.ray_loop.PATTERN_RAYS_PER_CALL", 70)
    for loop in widths.values():
        assert_same(loop, single, rays)
    part = rays.between(7, 31)
    assert np.array_equal(traced(single, part).open, traced(single, rays).open[7:31])


def test_a_direction_is_the_sum_of_rounded_products(scene):
    rays = pattern_rays(scene, 5, 7, mirrored=False)
    d = rays.directions().reshape(5, 7, 3)
    for point in range(5):
        x, y, z = rays.patterns.table[rays.patterns.row[point]]
        tangent, bitangent, normal = rays.frames[point]
        for k in range(3):
            assert np.array_equal(d[point, :, k], tangent[k] * x + bitangent[k] * y + normal[k] * z)


def test_mirrored_directions_point_above_their_triangle(scene):
    rays = pattern_rays(scene, 300, 64)
    rays.first_mirrored[:] = 0
    d = rays.directions().reshape(300, 64, 3)
    height = (d.astype(float) * rays.normals[:, None]).sum(axis=2)
    assert (height > 0).all()
    plain = pattern_rays(scene, 300, 64, mirrored=False).directions().reshape(300, 64, 3)
    before = (plain.astype(float) * rays.normals[:, None]).sum(axis=2)
    assert (before < 0).mean() > 0.2
    np.testing.assert_allclose(
        height, np.where(before < LEAST, np.maximum(-before, LEAST), before), atol=3e-7
    )


@pytest.mark.parametrize("samples", [1, 6, 64, 300])
def test_the_compact_table_holds_the_same_directions(samples):
    compact = compact_spiral_table(samples)
    assert sorted(compact.number) == list(range(samples))
    assert np.array_equal(compact.table, spiral_table(samples)[:, :, compact.number])


def test_rays_of_a_packet_are_near_each_other():
    def spread(table):
        groups = table[0, :2].reshape(2, -1, 16)
        return np.ptp(groups, axis=2).mean()

    assert spread(compact_spiral_table(256).table) < spread(spiral_table(256)) / 2


def test_a_tracer_counts_checks_and_stops(scene):
    vertices, triangles, *_ = scene
    tracer = Tracer(vertices, triangles)
    rays = pattern_rays(scene, 10, 6)
    tracer.trace_patterns(rays, np.inf, PatternResults.room(rays.shape))
    assert tracer.rays == 60
    out = PatternResults.room(rays.shape, "distance")
    tracer.trace_patterns(rays, np.inf, out)
    assert np.isinf(out.distance).any()
    for name, array in (("directions", rays.frames[3]), ("origins", rays.origins[4])):
        kept = array.copy()
        array[...] = np.nan
        with pytest.raises(IllumError, match=f"{name} that are not finite"):
            tracer.trace_patterns(rays, np.inf, out)
        array[...] = kept
    with pytest.raises(ValueError, match="above 0"):
        tracer.trace_patterns(rays, 0.0, out)


def test_no_points_have_no_results(scene):
    *_, single, widths = scene
    rays = pattern_rays(scene, 0, 6)
    for loop in (single, *widths.values()):
        assert traced(loop, rays, "is_open").is_open.shape == (0, 6)


def test_a_table_of_the_points_own_patterns(scene):
    *_, single, widths = scene
    rays = pattern_rays(scene, 20, 16, compact=False)
    own = np.ascontiguousarray(rays.patterns.table[:20][:, :, ::-1])
    rays = PatternRays(Patterns(own, np.arange(20, dtype=np.int32)), *list(vars(rays).values())[1:])
    for loop in widths.values():
        assert_same(loop, single, rays)
