from __future__ import annotations

import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.polygon_normals import area_vectors
from illumcli.geometry.triangulate import triangulate


def ragged(*polygons, vertices):
    starts = np.cumsum([0, *map(len, polygons)]).astype(np.int32)
    return Mesh(np.array(vertices, float), np.concatenate(polygons).astype(np.int32), starts)


def triangles_of(mesh):
    """The triangles as vertex numbers, each turned to begin with its smallest."""
    found = mesh.corners[triangulate(mesh).corners]
    return sorted(tuple(np.roll(t, -int(np.argmin(t))).tolist()) for t in found)


SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
ARROW = [[0, 0, 0], [4, 0, 0], [4, 4, 0], [2, 1, 0], [0, 4, 0]]


def test_triangles_stay_as_they_are():
    cut = triangulate(ragged([0, 1, 2], [2, 3, 0], vertices=SQUARE))
    assert cut.corners.tolist() == [[0, 1, 2], [3, 4, 5]]
    assert cut.polygon.tolist() == [0, 1]
    assert cut.corners.dtype == cut.polygon.dtype == np.int32


def test_a_quad_is_cut_along_its_shorter_diagonal():
    assert triangles_of(ragged([0, 1, 2, 3], vertices=SQUARE)) == [(0, 1, 2), (0, 2, 3)]
    long_even = [[0, 0, 0], [1, 0, 0], [3, 3, 0], [0, 1, 0]]
    assert triangles_of(ragged([0, 1, 2, 3], vertices=long_even)) == [(0, 1, 3), (1, 2, 3)]


@pytest.mark.parametrize("start", range(4))
def test_a_concave_quad_is_cut_inside(start):
    dart = [[-9, -9, 0], [4, 0, 0], [1, 1, 0], [0, 4, 0]]  # the shorter diagonal, 1 to 3, runs outside
    cut = triangles_of(ragged(np.roll(range(4), start), vertices=dart))
    assert all({0, 2} <= set(triangle) for triangle in cut)


def test_a_convex_polygon_is_a_fan_and_needs_no_library(monkeypatch):
    monkeypatch.setitem(sys.modules, "mapbox_earcut", None)
    angle = np.arange(7) * 2 * np.pi / 7
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    cut = triangulate(ragged([0, 1, 2], range(7), vertices=ring))
    assert cut.corners.tolist() == [[0, 1, 2], *([3, 3 + i, 4 + i] for i in range(1, 6))]
    assert cut.polygon.tolist() == [0, 1, 1, 1, 1, 1]


def test_straight_corners_do_not_make_a_polygon_concave(monkeypatch):
    monkeypatch.setitem(sys.modules, "mapbox_earcut", None)
    for step in np.linspace(0.1, 0.9, 17):
        edge = np.array([[0.1], [step], [1.0]]) * [0.7, 0.3, 0.1]
        points = [*edge, [0.3, 0.7, 0.1], [0.1, 0.6, 0.0]]
        assert len(triangulate(ragged(range(5), vertices=points)).corners) == 3


@pytest.mark.parametrize("turn", [0, 1, 2])
@pytest.mark.parametrize("way", [1, -1])
def test_a_concave_polygon_is_covered_once_and_on_the_same_side(turn, way):
    mesh = ragged(range(5)[::way], [0, 1, 2], vertices=np.roll(ARROW, turn, axis=1) + 3.0)
    cut = triangulate(mesh)
    areas = area_vectors(Mesh.of_triangles(mesh.vertices, mesh.corners[cut.corners]))
    np.testing.assert_allclose(areas[cut.polygon == 0].sum(axis=0), area_vectors(mesh)[0])
    np.testing.assert_allclose(np.linalg.norm(areas, axis=1)[cut.polygon == 0].sum(), 20)
    assert cut.polygon.tolist() == [0, 0, 0, 1]


@given(st.lists(st.floats(0.2, 1.0), min_size=3, max_size=12), st.integers(0, 2**32 - 1))
def test_star_shaped_polygons_of_all_kinds_keep_their_area(radii, seed):
    angle = 2 * np.pi * np.arange(len(radii)) / len(radii)
    flat = np.array(radii)[:, None] * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    mesh = ragged(range(len(radii)), vertices=flat @ turn.T)
    cut = triangulate(mesh)
    areas = area_vectors(Mesh.of_triangles(mesh.vertices, mesh.corners[cut.corners]))
    whole = np.linalg.norm(area_vectors(mesh)[0])
    np.testing.assert_allclose(areas.sum(axis=0), area_vectors(mesh)[0], atol=1e-8 * whole)
    np.testing.assert_allclose(np.linalg.norm(areas, axis=1).sum(), whole, rtol=1e-8)
    assert set(cut.corners.ravel().tolist()) == set(range(len(radii)))


def test_a_polygon_without_area_still_gives_triangles():
    line = [[0, 0, 0], [1, 1, 1], [2, 2, 2], [3, 3, 3], [1, 1, 1]]
    cut = triangulate(ragged([0, 1, 2], [0, 1, 2, 3], range(5), vertices=line))
    assert cut.polygon.tolist() == [0, 1, 1, 2, 2, 2]


def test_no_polygons_give_no_triangles():
    empty = triangulate(Mesh(np.zeros((2, 3)), np.zeros(0, np.int32), np.zeros(1, np.int32)))
    assert empty.corners.shape == (0, 3)
