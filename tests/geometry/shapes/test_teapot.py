from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from illumcli.geometry.shapes import teapot
from illumcli.geometry.shapes.teapot import Teapot

SHARED = Path(__file__).parents[4] / "shared/meshes/teapot.obj"


def as_newell_had_it(resolution):
    mesh = Teapot(resolution=resolution, size=teapot.RIGHT - teapot.LEFT).mesh()
    return mesh, mesh.vertices + np.array([(teapot.LEFT + teapot.RIGHT) / 2, teapot.HEIGHT / 2, 0])


def test_there_are_32_patches():
    mesh, points = as_newell_had_it(4)
    assert mesh.polygon_count == 32 * 16
    np.testing.assert_allclose(points.min(axis=0), [-3, 0, -2], atol=1e-14)
    np.testing.assert_allclose(points.max(axis=0)[1:], [3.15, 2], atol=1e-14)


@pytest.mark.skipif(not SHARED.exists(), reason="the shared meshes are not here")
def test_it_is_the_well_known_teapot_vertex_by_vertex():
    lines = (line.split() for line in SHARED.read_text().splitlines() if line.startswith("v "))
    theirs = np.array([line[1:4] for line in lines], float)  # 10 quads to a patch, six digits
    _, points = as_newell_had_it(10)
    for here, there in ((points, theirs), (theirs, points)):
        nearest = [np.abs(here - point).max(axis=1).min() for point in there]
        assert max(nearest) < 6e-7


def test_normals_are_those_of_the_surface_not_of_the_facets():
    """Facets approach the exact normals with the resolution, everywhere at least linearly."""
    from illumcli.geometry.polygon_normals import polygon_normals

    worst = []
    for resolution in (12, 24):
        mesh, _ = as_newell_had_it(resolution)
        facing = np.repeat(polygon_normals(mesh), np.diff(mesh.starts), axis=0)
        apart = np.linalg.norm(facing - mesh.normals[mesh.corner_normals], axis=1)
        worst.append((apart.mean(), apart.max()))
    assert worst[1][0] < 0.55 * worst[0][0]
    assert worst[1][1] < 0.6 * worst[0][1]


def test_the_poles_have_the_limit_of_the_normal():
    mesh, points = as_newell_had_it(8)
    for height, up in ((3.15, 1.0), (0.0, -1.0)):
        pole = (np.abs(points[:, [0, 2]]) < 1e-12).all(axis=1) & (np.abs(points[:, 1] - height) < 1e-12)
        assert pole.sum() == 1
        normals = mesh.normals[mesh.corner_normals[pole[mesh.corners]]]
        assert len(normals) == 32
        np.testing.assert_allclose(normals, np.tile([0, up, 0], (32, 1)), atol=1e-15)


def test_the_pot_is_a_little_wider_than_a_circle_between_its_quarters():
    """Newell's 0.56 gives quarters that are not quite round: 1.0041 radii at 45 degrees."""
    _, points = as_newell_had_it(2)
    ring = points[np.abs(points[:, 1] - 0.9) < 1e-12]
    radius = np.unique(np.hypot(ring[:, 0], ring[:, 2]).round(9))
    np.testing.assert_allclose(radius[[0, -1]], [2, 2 * np.sqrt(2) * (4 + 3 * 0.56) / 8], atol=1e-9)
