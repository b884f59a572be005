from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from illumcli.errors import InputError, LimitError
from illumcli.geometry.polygon_normals import area_vectors, polygon_normals
from illumcli.geometry.shapes import implicit
from illumcli.geometry.shapes.implicit import Implicit

TORUS = "(sqrt(x*x + z*z) - 0.6)**2 + y*y - 0.09"


def made(f, **scene):
    return Implicit.model_validate({"f": f, **scene}).mesh()


def edges(mesh):
    quads = mesh.corners.reshape(-1, 4)
    return list(zip(quads.ravel().tolist(), np.roll(quads, -1, axis=1).ravel().tolist(), strict=True))


def test_vertices_lie_on_the_surface_and_normals_are_the_gradient():
    torus = made(TORUS, resolution=24)
    p, n = torus.vertices[torus.corners], torus.normals[torus.corner_normals]
    ring = p * [1, 0, 1]
    ring *= 0.6 / np.linalg.norm(ring, axis=1, keepdims=True)
    np.testing.assert_allclose(np.linalg.norm(p - ring, axis=1), 0.3, rtol=1e-12)
    np.testing.assert_allclose(n, (p - ring) / 0.3, atol=1e-12)


@pytest.mark.parametrize(
    ("f", "genus"), [("x**2 + y**2 + z**2 - 0.7", 0), (TORUS, 1), ("x**4 + y**4 + z**4 - 0.5", 0)]
)
def test_a_closed_surface_is_watertight_and_has_its_topology(f, genus):
    mesh = made(f, resolution=20)
    sides = edges(mesh)
    assert len(set(sides)) == len(sides)
    assert {(b, a) for a, b in sides} == set(sides)
    assert len(mesh.vertices) - len(sides) // 2 + mesh.polygon_count == 2 - 2 * genus


def test_outside_is_where_f_is_above_zero():
    for f, side in (("x**2 + y**2 + z**2 - 0.7", 1), ("0.7 - x**2 - y**2 - z**2", -1)):
        mesh = made(f, resolution=12)
        facing = np.einsum(
            "ij,ij->i", np.repeat(polygon_normals(mesh), 4, axis=0), mesh.vertices[mesh.corners]
        )
        assert (facing * side > 0.5).all()
        own = np.einsum("ij,ij->i", mesh.normals[mesh.corner_normals], mesh.vertices[mesh.corners])
        assert (own * side > 0.5).all()


def test_the_area_converges():
    errors = []
    for resolution in (16, 32):
        mesh = made("x**2 + y**2 + z**2 - 0.64", resolution=resolution)
        errors.append(4 * np.pi * 0.64 - np.linalg.norm(area_vectors(mesh), axis=1).sum() / 2)
    assert errors[0] / errors[1] == pytest.approx(4, abs=0.8)
    assert errors[1] < 0.01


@pytest.mark.parametrize("f", ["z - x*x", "y", "x*x - y*y - z + 0.0"])
def test_surfaces_that_meet_round_numbers_have_no_pinched_faces(f):
    mesh = made(f, resolution=16)
    assert polygon_normals(mesh).any(axis=1).all()


def test_the_box_cuts_the_surface_within_two_cells():
    mesh = made("y", low=[-1, -0.5, -2], high=[1, 0.5, 2], resolution=40)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    np.testing.assert_allclose(low, [-1, 0, -2], atol=0.2)
    np.testing.assert_allclose(high, [1, 0, 2], atol=0.2)
    np.testing.assert_allclose(mesh.vertices[:, 1], 0, atol=1e-15)


def test_a_crease_and_a_singular_point_stay_finite_and_closed():
    for f in ("max(abs(x), max(abs(y), abs(z))) - 0.7", "abs(x) + abs(y) + abs(z) - 0.7"):
        mesh = made(f, resolution=16)
        assert np.isfinite(mesh.vertices).all()
        assert {(b, a) for a, b in edges(mesh)} == set(edges(mesh))
    cone = made("x*x + z*z - y*y", resolution=17)
    assert np.isfinite(cone.vertices).all()
    assert np.isfinite(cone.normals).all()


def test_layers_evaluated_apart_give_the_same_surface(monkeypatch):
    whole = made(TORUS, resolution=16)
    monkeypatch.setattr(implicit, "NODES_AT_ONCE", 1)
    np.testing.assert_array_equal(made(TORUS, resolution=16).vertices, whole.vertices)


def test_no_surface_in_the_box_is_said():
    with pytest.raises(InputError, match="does not change its sign in the box"):
        made("x**2 + y**2 + z**2 + 1", resolution=8)


def test_a_surface_of_too_many_triangles_is_refused(monkeypatch):
    monkeypatch.setattr(implicit, "MAX_TRIANGLES", 100)
    with pytest.raises(LimitError, match="at most 100 are made; lower `resolution`"):
        made("sin(50*x)*sin(50*y)*sin(50*z)", resolution=16)


def test_faults_are_named():
    with pytest.raises(ValidationError, match=r"f\n.*position 2: '\^' is not part of a formula"):
        made("x^2")
    with pytest.raises(ValidationError, match=r"high\n.*must be above low"):
        made("x", low=[0, 0, 0], high=[1, 0, 1])
