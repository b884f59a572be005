"""Cells of points, and the nearest cells of each."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.baking import cells as module
from illumcli.baking.cells import AGREE, SAME_CELL, SIZE, cells_of, nearest
from illumcli.geometry.spatial_order import compact


def sphere(count, seed=0):
    n = np.random.default_rng(seed).normal(size=(count, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    return np.asfortranarray(n, np.float32)


def test_every_point_is_in_one_cell_of_its_object_whose_normals_agree():
    n = sphere(1003)
    position = np.asfortranarray(np.random.default_rng(1).random((1003, 3)), np.float32)
    objects = np.random.default_rng(2).integers(0, 5, 1003).astype(np.int32)
    cells = cells_of(position, n, objects, compact(position), 4)
    assert sorted(cells.points[cells.filled]) == list(range(1003))
    first = cells.points[:, :1]
    cosine = (n[first] * n[cells.points]).sum(axis=2)
    assert cosine[cells.filled].min() >= SAME_CELL - 1e-6
    assert (objects[first] == objects[cells.points]).all()


def test_points_of_a_smooth_surface_fill_their_cells():
    n = sphere(4096)
    cells = cells_of(n, n, np.zeros(4096, np.int32), compact(n), 4)
    assert len(cells.points) < 1.2 * 4096 / SIZE


def test_two_sides_of_a_thin_sheet_share_no_cell_and_are_not_near():
    grid = np.random.default_rng(0).random((500, 3)) * [1, 0, 1]
    position = np.asfortranarray(np.concatenate([grid, grid - [0, 1e-6, 0]]), np.float32)
    n = np.asfortranarray(np.repeat([[0, 1, 0], [0, -1, 0]], 500, axis=0), np.float32)
    cells = cells_of(position, n, np.zeros(1000, np.int32), compact(position), 8)
    side = (cells.points < 500).astype(int)
    assert (side.min(axis=1) == side.max(axis=1)).all()
    near = np.append(side[:, 0], -1)[cells.near]
    assert ((near == side[:, :1]) | (near == -1)).all()
    assert (near[:, -1] != -1).all()


@pytest.mark.parametrize("brute", [8, 1 << 11])
def test_nearest_cells_are_those_of_a_full_search(monkeypatch, brute):
    monkeypatch.setattr(module, "BRUTE", brute)
    normal = sphere(1500).astype(np.float64)
    order = np.lexsort(np.floor(8 * normal).T)
    normal = normal[order]
    centre = np.concatenate([normal, np.zeros((1500, 1))], axis=1)
    found = nearest(centre, normal, 6)
    square = np.square(centre[:, None] - centre).sum(axis=2)
    square[normal @ normal.T < AGREE] = np.inf
    np.fill_diagonal(square, -1)
    exact = np.argsort(square, axis=1)[:, :6]
    assert (found[:, 0] == np.arange(1500)).all()
    assert np.mean([len({*a} & {*b}) for a, b in zip(found, exact, strict=True)]) > 5.8


def test_few_cells_have_few_neighbours():
    normal = np.repeat([[0.0, 1.0, 0.0]], 3, axis=0)
    centre = np.array([[0.0, 0, 0, 0], [1.0, 0, 0, 0], [0.5, 0, 0, 8.0]])
    assert nearest(centre, normal, 4).tolist() == [[0, 1, 3, 3], [1, 0, 3, 3], [2, 3, 3, 3]]
