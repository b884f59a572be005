from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from illumcli.errors import InputError
from illumcli.geometry.shapes.parametric import Parametric

TAU = 2 * np.pi
SPHERE = {
    "x": "cos(v)*cos(u)",
    "y": "sin(v)",
    "z": "-cos(v)*sin(u)",
    "u": [0, TAU],
    "v": [-np.pi / 2, np.pi / 2],
}


def made(**scene):
    return Parametric.model_validate(scene).mesh()


def corners(mesh):
    return mesh.vertices[mesh.corners], mesh.normals[mesh.corner_normals]


@pytest.mark.parametrize("change", [{}, {"u": [TAU, 2 * TAU]}])
def test_a_sphere_has_its_closed_form_normals(change):
    p, n = corners(made(**SPHERE | change))
    away_from_poles = np.abs(p[:, 1]) < 0.9999
    np.testing.assert_allclose(n[away_from_poles], p[away_from_poles], atol=1e-12)
    np.testing.assert_allclose(n, p, atol=1e-6)  # at the poles the limit is read beside them


def test_poles_may_lie_along_either_parameter():
    mesh = made(
        x="sin(u)*cos(v)", y="sin(u)*sin(v)", z="cos(u)", u=[0, np.pi], v=[0, TAU], resolution=[8, 12]
    )
    assert len(mesh.vertices) == 2 + 7 * 12
    assert np.bincount(np.diff(mesh.starts)).tolist() == [0, 0, 0, 24, 72]
    p, n = corners(mesh)
    np.testing.assert_allclose(n, p, atol=1e-6)


def test_flip_turns_faces_and_normals():
    (p, n), (q, m) = (
        corners(made(**SPHERE, resolution=[8, 6])),
        corners(made(**SPHERE, resolution=[8, 6], flip=True)),
    )
    np.testing.assert_allclose(n, p, atol=1e-6)
    np.testing.assert_allclose(m, -q, atol=1e-6)


def test_a_torus_closes_both_ways():
    torus = made(
        x="(2+cos(v))*cos(u)", y="sin(v)", z="-(2+cos(v))*sin(u)", u=[0, TAU], v=[0, TAU], resolution=[9, 7]
    )
    assert len(torus.vertices) == 63
    assert torus.polygon_count == 63


def test_a_moebius_strip_is_not_welded_with_its_other_side():
    strip = made(
        x="(1 + v/2*cos(u/2))*cos(u)", y="(1 + v/2*cos(u/2))*sin(u)", z="v/2*sin(u/2)",
        u=[0, TAU], v=[-0.5, 0.5], resolution=[16, 4],
    )  # fmt: skip
    assert len(strip.vertices) == 17 * 5


def test_a_double_cone_has_no_normal_in_its_middle():
    mesh = made(x="v*cos(u)", y="v", z="v*sin(u)", u=[0, TAU], v=[-0.1, 0.2], resolution=[8, 3])
    p, _ = corners(mesh)
    assert (mesh.corner_normals[np.abs(p).max(axis=1) < 1e-12] == -1).all()
    assert (mesh.corner_normals[np.abs(p).max(axis=1) > 1e-12] >= 0).all()


def test_a_hole_in_the_surface_is_named():
    with pytest.raises(InputError, match="parametric: y is not finite at u = 0, v = 0"):
        made(x="u", y="log(u)", z="v")


def test_a_line_is_no_surface():
    with pytest.raises(InputError, match="shrinks to a line"):
        made(x="u", y="0", z="1")


def test_faults_are_named():
    with pytest.raises(ValidationError, match=r"x\n.*position 3: unknown function 'sinn'"):
        made(x="1+sinn(u)", y="v", z="0")
    with pytest.raises(ValidationError, match=r"z\n.*unknown name 'x'; there are: u, v"):
        made(x="u", y="v", z="x")
    with pytest.raises(ValidationError, match=r"u\n.*must run from low to high, is \[1.0, 0.0\]"):
        made(x="u", y="v", z="0", u=[1, 0])
