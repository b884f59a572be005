"""Which objects share a mesh, and what they read of it."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.geometry import scene_geometry as geometries
from illumcli.geometry.bounds import object_bounds
from illumcli.geometry.instances import shared_meshes
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.planar import planar_polygons
from illumcli.geometry.scene_geometry import place_meshes, scene_geometry, without_culled
from illumcli.geometry.shapes.box import Box
from illumcli.geometry.shapes.torus import Torus
from illumcli.geometry.transforms import rotation
from illumcli.rays.interaction import uv_tangents

SHEARED = np.array([[1, 0.5, 0, 3], [0, 1, 0, -1], [0.2, 0, 1, 0], [0, 0, 0, 1.0]])
MIRRORED = np.diag([-2.0, 2, 2, 1])


QUADS = np.full(5, 4)


def test_objects_of_one_kind_share_a_mesh():
    plain = [np.eye(4)] * 5
    assert shared_meshes([0, 1, 2, 3, 4], plain, QUADS) == []
    (group,) = shared_meshes([0, 1, 0, 2, 0], plain, QUADS)
    assert (group.objects, group.mirrored) == ((0, 2, 4), False)


def test_mirrored_objects_share_a_mirror_image():
    one, other = shared_meshes([0] * 4, [np.eye(4), MIRRORED, MIRRORED, SHEARED], QUADS[:4])
    assert (one.objects, one.mirrored, other.objects, other.mirrored) == ((0, 3), False, (1, 2), True)


@pytest.mark.parametrize(("axes", "count"), [((1, 1, 3), 1), ((1, 1, 3.01), 0), ((1, 0, 1), 0)])
def test_matrices_that_stretch_too_far_are_no_instances(axes, count):
    assert len(shared_meshes([0, 0], [np.diag([*axes, 1.0])] * 2, QUADS[:2])) == count
    assert len(shared_meshes([0, 0], [np.eye(4), np.diag([*axes, 1.0])], QUADS[:2])) == count


@pytest.mark.parametrize(("corners", "count"), [(4, 1), (5, 0)])
def test_larger_polygons_are_not_stretched(corners, count):
    turned = rotation(1, 30.0) * 2
    assert len(shared_meshes([0, 0], [turned, np.eye(4)], np.full(2, corners))) == 1
    assert len(shared_meshes([0, 0], [turned, np.diag([1, 1, 1.1, 1])], np.full(2, corners))) == count


def shared_and_own(mesh: Mesh):
    """Three objects of a mesh and one of its own, with a shared mesh and without."""
    meshes, matrices = [mesh, Box().mesh(), mesh, mesh], [SHEARED, np.eye(4), SHEARED @ SHEARED, MIRRORED]
    matrices += [MIRRORED @ SHEARED]
    meshes += [mesh]
    bounds = object_bounds(meshes, matrices)
    shared = scene_geometry([True] * 5, [0, 1, 0, 0, 0], meshes, bounds)
    return shared, place_meshes(meshes, matrices)


@pytest.fixture(params=["smooth", "polygons"])
def both(request):
    mesh = Torus().mesh() if request.param == "smooth" else Box().mesh()
    return shared_and_own(mesh)


def every_triangle(shared, own):
    """Object and stored triangle of each triangle of `own`, in `shared`."""
    objects = own.objects
    within = np.arange(len(objects)) - own.first_number[objects]
    first = np.array([placed.first_triangle for placed in shared.placed])
    return objects, (first[shared.placed_mesh[objects]] + within).astype(np.int32)


def test_a_shared_mesh_is_stored_once(both):
    shared, own = both
    assert len(shared.placed) == 3  # the box, the mesh and its mirror image
    assert shared.triangle_count == own.triangle_count == len(own.triangles)
    objects, triangle = every_triangle(shared, own)
    assert np.array_equal(shared.triangle_numbers(objects, triangle), np.arange(len(own.triangles)))


def test_corners_and_normals_are_those_of_copies(both):
    shared, own = both
    objects, triangle = every_triangle(shared, own)
    every = np.arange(len(own.triangles), dtype=np.int32)
    tables = [geometries.corner_normals((None,) * 5, each) for each in (shared, own)]
    uvs = [geometries.scene_uvs(each) for each in (shared, own)]
    tangents = [uv_tangents(*each) for each in zip((shared, own), uvs, strict=True)]
    for k in range(3):
        a, b = shared.corner_positions(objects, triangle, k), own.corner_positions(objects, every, k)
        np.testing.assert_allclose(a, b, atol=3e-7)
        corners = shared.corners[triangle, k], own.corners[:, k]
        n, m = (table.values[table.index[corner]] for table, corner in zip(tables, corners, strict=True))
        np.testing.assert_allclose(shared.unit_normals(objects, n), m, atol=1e-6)
        n, m = (table.values[table.index[corner]] for table, corner in zip(uvs, corners, strict=True))
        assert np.array_equal(n, m)
        n, m = (table.values[table.index[corner]] for table, corner in zip(tangents, corners, strict=True))
        # Means over triangles, weighted by angles, which a shear changes.
        np.testing.assert_allclose(shared.unit_directions(objects, n), m, atol=0.05)


def test_polygons_are_those_of_copies(both):
    shared, own = both
    objects, triangle = every_triangle(shared, own)
    polygon = shared.polygons[triangle], own.polygons
    normals = [geometries.polygon_normals(("newell",) * 5, each) for each in (shared, own)]
    n = shared.unit_normals(objects, normals[0][polygon[0]])
    np.testing.assert_allclose(n, normals[1][polygon[1]], atol=1e-6)
    centres = [geometries.polygon_centres(each).position for each in (shared, own)]
    np.testing.assert_allclose(
        shared.positions(objects, centres[0][polygon[0]]), centres[1][polygon[1]], atol=3e-7
    )
    a, b = planar_polygons(shared), planar_polygons(own)
    assert (a is None) == (b is None)
    if a is not None:
        assert np.array_equal(a.row[triangle] >= 0, b.row >= 0)
        n = shared.unit_normals(objects, a.normal[a.row[triangle]])
        np.testing.assert_allclose(n[b.row >= 0], b.normal[b.row[b.row >= 0]], atol=1e-6)


def test_culling_changes_no_other_object():
    mesh, other = Torus().mesh(), Box().mesh()
    meshes, matrices = [mesh, other, mesh, mesh], [SHEARED, np.eye(4), MIRRORED @ MIRRORED, np.eye(4)]
    bounds = object_bounds(meshes, matrices)
    every, some, one = (
        scene_geometry([True] * 4, [0, 1, 0, 0], without_culled(culled, meshes), bounds)
        for culled in ((), (0, 2), (0, 1, 2))
    )
    for geometry in (some, one):
        assert geometry.instances.object.tolist() == [3]
        assert np.array_equal(geometry.instances.matrix[0], every.instances.matrix[2])
        assert np.array_equal(geometry.vertices[-len(mesh.vertices) :], every.vertices[-len(mesh.vertices) :])
    assert (
        scene_geometry([True] * 4, [0, 1, 0, 0], without_culled((0, 2, 3), meshes), bounds).instances is None
    )


def test_a_flat_object_leaves_the_normals_of_a_smooth_one():
    mesh = Torus().mesh()
    bounds = object_bounds([mesh, mesh], [np.eye(4), SHEARED])
    geometry = scene_geometry([True] * 2, [0, 0], [mesh, mesh], bounds)
    one, other = (geometries.corner_normals(how, geometry) for how in (("flat", None), (None, None)))
    assert np.array_equal(one.values, other.values)
    assert len(geometries.corner_normals(("flat", "flat"), geometry).values) == mesh.polygon_count
