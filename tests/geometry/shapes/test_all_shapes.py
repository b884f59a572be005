"""What every shape promises."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError

from illumcli.geometry.polygon_normals import area_vectors, polygon_normals
from illumcli.geometry.shapes import AnyShape
from illumcli.geometry.shapes._base import MAX_TRIANGLES
from illumcli.geometry.triangulate import triangulate
from illumcli.schema.families import members
from illumcli.schema.sources import tags

SHAPE = TypeAdapter(AnyShape)
PACKAGE = "illumcli.geometry.shapes"
TAU = 2 * np.pi

SPHERE = {"x": "sin(v)*cos(u)", "y": "sin(v)*sin(u)", "z": "-cos(v)", "u": [0, TAU], "v": [0, np.pi]}
CLOSED = {
    "box": {"shape": "box", "size": [1, 2, 3], "resolution": 4},
    "sphere": {"shape": "sphere", "segments": 24, "rings": 12},
    "coarsest sphere": {"shape": "sphere", "segments": 3, "rings": 2},
    "torus": {"shape": "torus", "segments": 24, "sides": 12},
    "cylinder": {"shape": "cylinder", "segments": 24, "rings": 3},
    "cone": {"shape": "cone", "segments": 24, "rings": 3},
    "polygons": {
        "shape": "polygons",
        "vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]],
        "faces": [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
    },
    "parametric sphere": {"shape": "parametric", **SPHERE},
    "raised text": {"shape": "text", "text": "A&8 %i", "depth": 0.2},
    "implicit sphere": {"shape": "implicit", "f": "x**2 + y**2 + z**2 - 0.7", "resolution": 20},
}
OPEN = {  # and the edges of their rims
    "plane": ({"shape": "plane", "resolution": [3, 2]}, 10),
    "disc": ({"shape": "disc", "segments": 24, "rings": 3}, 24),
    "tube": ({"shape": "cylinder", "segments": 24, "caps": False}, 48),
    "funnel": ({"shape": "cone", "segments": 24, "caps": False}, 24),
    "parametric tube": ({"shape": "parametric", "x": "cos(u)", "y": "sin(u)", "z": "v", "u": [0, TAU]}, 128),
    "teapot": ({"shape": "teapot", "resolution": 6}, 4 * 6 * 2 + 2 * 6 * 4),
}
EVERY = CLOSED | {name: scene for name, (scene, _) in OPEN.items()}


@pytest.mark.parametrize("name", EVERY)
def test_no_shape_makes_more_triangles_than_it_says(name):
    shape = SHAPE.validate_python(EVERY[name])
    assert len(triangulate(shape.mesh()).corners) <= shape.triangles() <= MAX_TRIANGLES


def made(scene):
    return SHAPE.validate_python(scene).mesh()


def volume(mesh):
    triangles = mesh.vertices[mesh.corners[triangulate(mesh).corners]]
    return np.linalg.det(triangles).sum() / 6


def area(mesh):
    return np.linalg.norm(area_vectors(mesh), axis=1).sum() / 2


def edges(mesh):
    """From and to which vertex each side of each polygon runs."""
    following = np.arange(1, len(mesh.corners) + 1)
    following[mesh.starts[1:] - 1] = mesh.starts[:-1]
    return list(zip(mesh.corners.tolist(), mesh.corners[following].tolist(), strict=True))


@pytest.mark.parametrize("scene", CLOSED.values(), ids=CLOSED)
def test_closed_shapes_share_each_edge_once_in_each_direction(scene):
    sides = edges(made(scene))
    assert len(set(sides)) == len(sides)
    assert {(b, a) for a, b in sides} == set(sides)
    assert volume(made(scene)) > 0


@pytest.mark.parametrize(("scene", "rim"), OPEN.values(), ids=OPEN)
def test_open_shapes_are_open_at_their_rims_alone(scene, rim):
    sides = edges(made(scene))
    assert len(set(sides)) == len(sides)
    assert len(set(sides) - {(b, a) for a, b in sides}) == rim


@pytest.mark.parametrize("scene", EVERY.values(), ids=EVERY)
def test_faces_have_an_area_and_turn_where_their_normals_point(scene):
    mesh = made(scene)
    facing = np.repeat(polygon_normals(mesh), np.diff(mesh.starts), axis=0)
    assert facing.any(axis=1).all()
    if mesh.normals is not None:
        own = mesh.normals[mesh.corner_normals]
        assert (mesh.corner_normals >= 0).all()
        np.testing.assert_allclose(np.linalg.norm(own, axis=1), 1, atol=1e-12)
        assert (np.einsum("ij,ij->i", own, facing) > 0.2).all()


@pytest.mark.parametrize("scene", EVERY.values(), ids=EVERY)
def test_every_vertex_is_used_and_stands_alone(scene):
    mesh = made(scene)
    assert len(np.unique(mesh.corners)) == len(mesh.vertices)
    assert (
        len(np.unique(mesh.vertices.round(9) + 0.0, axis=0)) == len(mesh.vertices)
        or "teapot" in scene["shape"]
    )
    if mesh.uvs is not None:
        used = mesh.uvs[mesh.corner_uvs]
        assert (used >= -1e-15).all()
        assert (used <= 1 + 1e-15).all()


def test_exact_normals_of_round_shapes():
    sphere = made({"shape": "sphere", "radius": 2.5})
    p, n = sphere.vertices[sphere.corners], sphere.normals[sphere.corner_normals]
    np.testing.assert_allclose(n, p / 2.5, atol=1e-12)

    torus = made({"shape": "torus", "major": 2, "minor": 0.5})
    p, n = torus.vertices[torus.corners], torus.normals[torus.corner_normals]
    ring = p * [1, 0, 1]
    ring *= 2 / np.linalg.norm(ring, axis=1, keepdims=True)
    np.testing.assert_allclose(n, (p - ring) / 0.5, atol=1e-12)

    tube = made({"shape": "cylinder", "radius": 2, "caps": False})
    p, n = tube.vertices[tube.corners], tube.normals[tube.corner_normals]
    np.testing.assert_allclose(n, p * [0.5, 0, 0.5], atol=1e-12)

    funnel = made({"shape": "cone", "radius": 3, "height": 4, "caps": False, "rings": 2})
    p, n = funnel.vertices[funnel.corners], funnel.normals[funnel.corner_normals]
    np.testing.assert_allclose(n[:, 1], 0.6, atol=1e-12)
    below = p[:, 1] < 1.9
    out = (p * [1, 0, 1])[below]
    np.testing.assert_allclose(
        n[below] * [1, 0, 1], 0.8 * out / np.linalg.norm(out, axis=1)[:, None], atol=1e-12
    )


def test_the_normal_at_a_cones_apex_is_that_of_the_triangles_middle():
    cone = made({"shape": "cone", "segments": 8, "caps": False})
    n = cone.normals[cone.corner_normals].reshape(-1, 3, 3)
    apex = cone.vertices[cone.corners].reshape(-1, 3, 3)[..., 1] == 1
    assert (apex.sum(axis=1) == 1).all()
    middle = n[~apex].reshape(-1, 2, 3).sum(axis=1)[:, [0, 2]]
    at_apex = n[apex][:, [0, 2]]
    np.testing.assert_allclose(
        at_apex / np.linalg.norm(at_apex, axis=1)[:, None],
        middle / np.linalg.norm(middle, axis=1)[:, None],
        atol=1e-12,
    )


@pytest.mark.parametrize(
    ("scene", "keys", "volume_", "area_"),
    [
        ({"shape": "sphere"}, ("segments", "rings"), 4 / 3 * np.pi, 4 * np.pi),
        ({"shape": "torus"}, ("segments", "sides"), np.pi * TAU * 0.75 / 16, TAU * TAU * 0.75 / 4),
        ({"shape": "cylinder"}, ("segments",), TAU, TAU * 3),
        ({"shape": "cone"}, ("segments",), TAU / 3, np.pi * (1 + np.sqrt(5))),
        ({"shape": "disc"}, ("segments",), 0, np.pi),
    ],
    ids=lambda value: value["shape"] if isinstance(value, dict) else "",
)
def test_volume_and_area_converge_with_the_square_of_the_resolution(scene, keys, volume_, area_):
    coarse, fine = (made(scene | dict.fromkeys(keys, count)) for count in (32, 64))
    for measure, exact in ((volume, volume_), (area, area_)):
        if exact:
            errors = exact - measure(coarse), exact - measure(fine)
            assert errors[1] < 0.02 * exact
            assert errors[0] / errors[1] == pytest.approx(4, abs=0.1)


def test_boxes_and_planes_have_the_size_asked_for():
    box = made({"shape": "box", "size": [1, 2, 3], "resolution": 4})
    np.testing.assert_array_equal(np.ptp(box.vertices, axis=0), [1, 2, 3])
    assert volume(box) == pytest.approx(6)
    plane = made({"shape": "plane", "size": [4, 3], "resolution": [5, 7]})
    assert area(plane) == pytest.approx(12)
    np.testing.assert_array_equal(np.ptp(plane.vertices, axis=0), [4, 0, 3])
    np.testing.assert_array_equal(plane.normals[plane.corner_normals], np.tile([0, 1, 0], (140, 1)))


@pytest.mark.parametrize("scene", EVERY.values(), ids=EVERY)
def test_textures_are_not_mirrored(scene):
    """Where the surface is seen from outside, uv turn counter-clockwise as the corners do."""
    mesh = made(scene)
    if mesh.uvs is None:
        pytest.skip("no uv")
    uv = mesh.uvs[mesh.corner_uvs[triangulate(mesh).corners]]
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    assert (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] > 0).all()


@pytest.mark.parametrize(
    "tag", [tag for tag in tags(PACKAGE) if tag not in ("polygons", "parametric", "implicit", "text")]
)
def test_by_default_a_shape_fills_the_cube_from_minus_1_to_1(tag):
    points = made({"shape": tag}).vertices
    np.testing.assert_allclose(
        points.min(axis=0), -points.max(axis=0), atol=0.02 if tag == "teapot" else 1e-15
    )
    assert np.abs(points).max() == pytest.approx(1, abs=1e-3)


def test_the_tag_of_a_shape_is_the_name_of_its_file():
    for tag, Shape in zip(tags(PACKAGE), members(PACKAGE), strict=True):
        assert Shape.model_fields["shape"].default == tag


@pytest.mark.parametrize(
    ("scene", "most"),
    [
        ({"shape": "sphere", "segments": 4096, "rings": 2048}, 2 * 4096 * 2048),
        ({"shape": "torus", "segments": 4096, "sides": 2048}, 2 * 4096 * 2048),
        ({"shape": "cylinder", "segments": 4096, "rings": 2048}, 2 * 4096 * 2049),
        ({"shape": "cone", "segments": 4096, "rings": 2048}, 2 * 4096 * 2049),
        ({"shape": "disc", "segments": 4096, "rings": 2048}, 2 * 4096 * 2048),
        ({"shape": "plane", "resolution": [3000, 3000]}, 2 * 3000 * 3000),
        ({"shape": "parametric", "x": "u", "y": "v", "z": "0", "resolution": [3000, 3000]}, 2 * 3000 * 3000),
        ({"shape": "box", "resolution": 1024}, 12 * 1024 * 1024),
        ({"shape": "teapot", "resolution": 512}, 64 * 512 * 512),
    ],
    ids=lambda value: value["shape"] if isinstance(value, dict) else "",
)
def test_the_finest_shape_stays_below_the_limit_and_finer_is_refused(scene, most):
    assert most <= MAX_TRIANGLES
    SHAPE.validate_python(scene)
    for key in scene.keys() & {"segments", "rings", "sides", "resolution"}:
        finer = [3001, 3001] if isinstance(scene[key], list) else scene[key] + 1
        with pytest.raises(ValidationError, match="less than or equal"):
            SHAPE.validate_python(scene | {key: finer})


@pytest.mark.parametrize(
    ("scene", "message"),
    [
        ({"shape": "spher"}, "did you mean 'sphere'"),
        ({"shape": "sphere", "radius": 0}, "greater than 0"),
        ({"shape": "sphere", "segments": 2}, "greater than or equal to 3"),
        ({"shape": "sphere", "rings": 1}, "greater than or equal to 2"),
        ({"shape": "torus", "minor": 0.75}, r"minor\n.*must be smaller than major, 0.75"),
        ({"shape": "box", "size": [1, 1]}, "size"),
        ({"shape": "plane", "height": 1}, "height\n.*[Ee]xtra"),
    ],
)
def test_what_makes_no_sense_is_refused(scene, message):
    with pytest.raises(ValidationError, match=message):
        SHAPE.validate_python(scene)
