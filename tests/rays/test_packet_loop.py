"""Packets give the bits of embreex's own loop, for any width, rays and neighbours."""

from __future__ import annotations

import os

import numpy as np
import pytest

from illumcli.compiled import SWITCH
from illumcli.rays import packet_loop
from illumcli.rays.packet_loop import PacketLoop, missing, native_widths
from illumcli.rays.ray_loop import NO_LIMIT, ray_loop, ray_loop_name, why_no_packets
from illumcli.rays.single_ray_loop import SingleRayLoop

F = np.float32
UNLIMITED = np.asarray(NO_LIMIT)


@pytest.fixture(scope="module", autouse=True)
def _needs_packets():
    if (why := missing()) is not None:
        assert os.environ.get("ILLUM_REQUIRE_PACKETS") != "1", why
        pytest.skip(why)


def clutter(rng, count):
    """Triangles of all sizes: needles, coplanar ones that overlap, pairs in one place, some of area 0."""
    size = rng.gamma(0.3, 0.3, (count, 1, 1))
    corners = rng.uniform(-1, 1, (count, 1, 3)) + size * rng.normal(size=(count, 3, 3))
    corners[::5, :, 1] = 0.25
    corners[1::50] = corners[::50][: len(corners[1::50])]
    corners[7::40, 2] = corners[7::40, 1]
    return corners.reshape(-1, 3).astype(F), np.arange(3 * count, dtype=np.int32).reshape(-1, 3)


def aimed_rays(rng, vertices, triangles, count):
    """Origins and directions of `count` rays: random, at vertices, edges and faces, along edges and axes."""
    o = rng.normal(size=(count, 3)).astype(F) * F(1.5)
    triangle = triangles[rng.integers(0, len(triangles), count)]
    a, b, c = (vertices[triangle[:, k]] for k in range(3))
    share = rng.random((count, 1)).astype(F)
    kind = np.arange(count)[:, None] % 6
    d = np.select(
        [kind == 0, kind == 1, kind == 2, kind == 3, kind == 4],
        [
            rng.normal(size=(count, 3)).astype(F),
            a - o,
            a * share + b * (1 - share) - o,
            (a + b + c) / 3 - o,
            b - a,
        ],
        np.eye(3, dtype=F)[rng.integers(0, 3, count)],
    )
    o = np.where(kind == 4, a + (c - a) * F(0.25), o)
    return np.asfortranarray(o), np.asfortranarray(d)


@pytest.fixture(scope="module")
def scene():
    rng = np.random.default_rng(4)
    vertices, triangles = clutter(rng, 3000)
    loops = {width: PacketLoop(vertices, triangles, width) for width in (1, *native_widths())}
    return vertices, triangles, SingleRayLoop(vertices, triangles), loops


def assert_same(loop, single, o, d, limits=UNLIMITED):
    hidden, expected = single.occluded(o, d, limits), single.closest(o, d)
    hit = expected.triangle >= 0
    for coherent in (False, True):
        assert np.array_equal(loop.occluded(o, d, limits, coherent), hidden)
        hits = loop.closest(o, d, coherent)
        assert np.array_equal(hits.triangle, expected.triangle)
        for name in ("u", "v", "distance"):
            assert getattr(hits, name)[hit].tobytes() == getattr(expected, name)[hit].tobytes()
    assert loop.distance(o, d).tobytes() == single.distance(o, d).tobytes()


@pytest.mark.parametrize("rounds", [1, pytest.param(180, marks=pytest.mark.slow)])
def test_every_width_gives_the_bits_of_single_rays(scene, rounds):
    vertices, triangles, single, loops = scene
    rng = np.random.default_rng(1)
    for _ in range(rounds):
        o, d = aimed_rays(rng, vertices, triangles, 60_000)
        limits = rng.gamma(0.5, 1.0, len(d)).astype(F)
        for loop in loops.values():
            assert_same(loop, single, o, d)
            assert_same(loop, single, o, d, limits)


def test_the_company_of_a_ray_changes_nothing(scene):
    vertices, triangles, _, loops = scene
    o, d = aimed_rays(np.random.default_rng(2), vertices, triangles, 20_000)
    order = np.random.default_rng(3).permutation(len(d))
    for loop in loops.values():
        hits, shuffled = loop.closest(o, d), loop.closest(o[order], d[order])
        for name in ("triangle", "distance"):
            assert getattr(hits, name)[order].tobytes() == getattr(shuffled, name).tobytes()
        assert np.array_equal(
            loop.occluded(o, d, UNLIMITED)[order], loop.occluded(o[order], d[order], UNLIMITED)
        )


def test_packets_that_are_not_full_answer_for_their_rays_only(scene):
    vertices, triangles, single, loops = scene
    o, d = aimed_rays(np.random.default_rng(5), vertices, triangles, 40)
    for loop in loops.values():
        for count in range(1, 41):
            assert_same(loop, single, o[:count], d[:count])
        assert len(loop.occluded(o[:0], d[:0], UNLIMITED)) == 0


def test_an_origin_stands_for_several_rays(scene):
    vertices, triangles, single, loops = scene
    o, d = aimed_rays(np.random.default_rng(6), vertices, triangles, 1155)
    for loop in loops.values():
        for each in (1, 3, 5, 7, 11, 33, 1155):
            assert_same(loop, single, o[: len(d) // each], d)


def test_arrays_of_any_strides_are_read(scene):
    vertices, triangles, single, loops = scene
    o, d = aimed_rays(np.random.default_rng(7), vertices, triangles, 300)
    wide = np.zeros((600, 9), F)
    wide[::2, 1:7:2] = d
    for loop in loops.values():
        assert_same(loop, single, np.ascontiguousarray(o), wide[::2, 1:7:2])
        assert_same(loop, single, o[::-1], d[::-1])


def test_calls_in_parts_are_one_answer(scene, monkeypatch):
    vertices, triangles, single, loops = scene
    o, d = aimed_rays(np.random.default_rng(8), vertices, triangles, 700)
    monkeypatch.setattr("illumcli.rays.ray_loop.RAYS_PER_CALL", 100)
    for loop in loops.values():
        assert_same(loop, single, o[:100], d)


def test_the_switch_leaves_packets_aside(scene, monkeypatch):
    vertices, triangles, *_ = scene
    assert isinstance(ray_loop(vertices, triangles), PacketLoop) == (os.environ.get(SWITCH) != "0")
    monkeypatch.setenv(SWITCH, "0")
    assert isinstance(ray_loop(vertices, triangles), SingleRayLoop)
    assert ray_loop_name() == "single rays by embreex (ILLUM_PACKETS=0)"
    monkeypatch.delenv(SWITCH)
    assert ray_loop_name() == f"packets of {native_widths()[0]} rays"


def test_what_is_missing_is_named(monkeypatch):
    monkeypatch.delenv(SWITCH, raising=False)
    monkeypatch.setattr(packet_loop, "native_widths", lambda: ())
    assert why_no_packets() == "the processor has no native packets"
    monkeypatch.setattr(packet_loop, "embree_library", lambda: None)
    assert why_no_packets() == "no Embree library found in embreex"
    monkeypatch.setattr(packet_loop, "packet_library", lambda: None)
    assert why_no_packets() == "no compiled loop"


def test_a_library_of_another_interface_is_not_used(monkeypatch):
    monkeypatch.setattr(packet_loop, "INTERFACE", -1)
    packet_loop.packet_library.cache_clear()
    try:
        assert packet_loop.packet_library() is None
    finally:
        packet_loop.packet_library.cache_clear()
