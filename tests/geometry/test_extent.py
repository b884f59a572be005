"""Boxes of meshes under matrices, from few vertices and from all."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.geometry import bounds, extent
from illumcli.geometry.bounds import implied_widths, object_bounds, widest_polygon
from illumcli.geometry.extent import Extent, extents
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes.sphere import Sphere
from illumcli.geometry.shapes.torus import Torus
from illumcli.geometry.transforms import rotation


def scattered(random: np.random.Generator, count: int) -> np.ndarray:
    return random.normal(size=(count, 3)) * 10 ** random.uniform(-2, 2, 3) + random.normal(size=3)


@pytest.mark.parametrize("count", [2, 63, 64, 65, 1000, 20_000])
def test_a_box_has_the_bits_of_all_vertices(count):
    random = np.random.default_rng(count)
    for vertices in (scattered(random, count), np.round(scattered(random, count))):
        found = Extent(vertices)
        for _ in range(20):
            matrix, shift = random.normal(size=(3, 3)), random.normal(size=3)
            points = vertices @ matrix.T + shift
            low, high = found.box(matrix, shift)
            assert np.array_equal(low, points.min(axis=0))
            assert np.array_equal(high, points.max(axis=0))


def test_bounds_of_many_copies_are_those_of_each(monkeypatch):
    random = np.random.default_rng(1)
    mesh = Torus().mesh()
    unused = Mesh(np.vstack([mesh.vertices, [[1e3] * 3]]), mesh.corners, mesh.starts)
    matrices = []
    for _ in range(20):
        matrix = rotation(0, random.uniform(0, 360)) @ rotation(1, random.uniform(0, 360))
        matrix[:3, 3] = random.normal(size=3)
        matrices.append(matrix)
    meshes = [unused] * 20
    assert len(extents(meshes)) == 1
    made = object_bounds(meshes, matrices)
    monkeypatch.setattr(extent, "MANY", 1000)
    each = object_bounds(meshes, matrices)
    assert np.array_equal(made.low, each.low)
    assert np.array_equal(made.high, each.high)
    assert made.render_space == each.render_space


def test_boxes_of_small_meshes_together_are_those_of_each_alone():
    random = np.random.default_rng(3)
    small, large = Sphere(segments=8, rings=6).mesh(), Torus().mesh()
    unused = Mesh(np.vstack([small.vertices, [[1e3] * 3]]), small.corners, small.starts)
    meshes = [(small, unused, large)[k] for k in random.integers(0, 3, 600)]
    matrices = [np.eye(4) for _ in meshes]
    for matrix in matrices:
        matrix[:3] = random.normal(size=(3, 4))
    made = object_bounds(meshes, matrices)
    for number, (mesh, matrix) in enumerate(zip(meshes, matrices, strict=True)):
        alone = object_bounds([mesh], [matrix])
        assert np.array_equal(made.low[number], alone.low[0])
        assert np.array_equal(made.high[number], alone.high[0])


def test_widths_of_copies_are_bounds(monkeypatch):
    random = np.random.default_rng(2)
    mesh = Sphere(segments=8, rings=6).mesh()
    matrices = [
        np.eye(4),
        *(rotation(k % 3, random.uniform(0, 360)) @ np.diag([1, 2, 3, 1]) for k in range(9)),
    ]
    objects = object_bounds([mesh] * 10, matrices)
    widths = implied_widths([False] * 9 + [True], [mesh] * 10, objects)
    exact = [bounds.widest_polygon(mesh, matrix) for matrix in matrices]
    assert (widths[:9] >= exact[:9]).all()
    assert (widths[:9] < 4 * np.array(exact[:9])).all()
    assert widths[9] == 0
    alone = implied_widths([False], [mesh], object_bounds([mesh], [matrices[1]]))
    assert alone[0] == widest_polygon(mesh, matrices[1])
