"""Shadows: no false terminator on smooth surfaces, and no occluder that a ray jumps over."""

from __future__ import annotations

import json

import numpy as np
import pytest

from illumcli.arrays import F, column_major
from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.geometry.corner_normals import corner_normals
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.scene_geometry import place_meshes, scene_normals
from illumcli.geometry.smooth_parts import SmoothParts
from illumcli.images.reader import read_image
from illumcli.rays.corner_weights import TriangleCorners, corner_weights
from illumcli.rays.interaction import ShadingContext, interact
from illumcli.stress.rays import icosphere
from illumcli.visibility.shadows import SEARCHES, smooth_surface

SUN = np.array([-0.4, 1.0, 0.2]) / np.linalg.norm([-0.4, 1.0, 0.2])
"""Unit vector to the light."""
LAYERS = ["shadows", "position", "normal", "geometric_normal", "object_id", "alpha"]
BOX = np.array([[x, y, z] for x in (-2, 2) for y in (-0.1, 0.1) for z in (-2, 2)], float)
BOX_FACES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
TOP = 0.1
NEAR = {"position": [2.5, 1, 2.5], "target": [0, 0, 0]}
"""A camera that sees a unit ball with its terminator across."""


def obj(*bodies: tuple[np.ndarray, list[list[int]], np.ndarray]) -> str:
    """A file of bodies, each (vertices, faces, a normal per vertex)."""
    text, first = "", 1
    for vertices, faces, normals in bodies:
        text += "".join("v {!r} {!r} {!r}\n".format(*map(float, v)) for v in vertices)
        text += "".join("vn {!r} {!r} {!r}\n".format(*map(float, n)) for n in normals)
        text += "".join("f " + " ".join(f"{i + first}//{i + first}" for i in face) + "\n" for face in faces)
        first += len(vertices)
    return text


def smooth_box() -> tuple[np.ndarray, list[list[int]], np.ndarray]:
    """A slab of eight vertices, whose normals make it one smooth body."""
    return BOX, BOX_FACES, BOX / [2, 0.1, 2] / np.sqrt(3)


def ball(centre, radius=0.3, divisions=3) -> tuple[np.ndarray, list[list[int]], np.ndarray]:
    mesh = icosphere(divisions)
    faces = mesh.corners.reshape(-1, 3).tolist()
    return mesh.vertices * radius + np.asarray(centre), faces, mesh.vertices


@pytest.fixture
def picture(tmp_path):
    """Channels of objects, each an OBJ text, under one sun."""

    def render(*objects, camera=None, **scene):
        names = []
        for number, text in enumerate(objects):
            names.append(f"{number}.obj")
            (tmp_path / names[-1]).write_text(text)
        said = {
            "version": 1,
            "film": {"width": 96, "height": 72, "samples": 1},
            "camera": camera or {"position": [2, 3, 5], "target": [0, 0.2, 0], "fov": 45},
            "objects": [{"mesh": name} for name in names],
            "lights": [{"light": "directional", "name": "sun", "direction": (-SUN).tolist()}],
            "outputs": {"layers": LAYERS, "colour": "float"},
            **scene,
        }
        (tmp_path / "scene.yaml").write_text(json.dumps(said))
        render_scene(
            RenderJob(
                tmp_path / "scene.yaml",
                RenderOptions(pattern=str(tmp_path / "out.exr"), cache=False, force=True),
            )
        )
        return read_image(tmp_path / "out.exr").channels

    return render


def vectors(channels, name):
    return np.stack([channels[f"{name}.{axis}"] for axis in "XYZ"], axis=-1)


def behind_ball(channels, centre, radius=0.3):
    """Pixels of the slab's top whose way to the sun meets the ball, by the ray-sphere test."""
    p = vectors(channels, "P")
    to_p = p - np.asarray(centre)
    along = to_p @ SUN
    gap = along**2 - ((to_p**2).sum(axis=-1) - radius**2)
    top = (np.abs(p[..., 1] - TOP) < 1e-4) & (channels["A"] == 1)
    return top & (along < 0) & (gap > 0.02 * radius**2)


@pytest.mark.parametrize("together", [False, True], ids=["two files", "one file"])
@pytest.mark.parametrize("rate", ["phong", "quadratic", "gouraud"])
def test_a_ball_on_a_smooth_slab_of_eight_vertices_casts_its_shadow(picture, rate, together):
    centre = [0, TOP + 0.3, 0]
    texts = [obj(smooth_box(), ball(centre))] if together else [obj(smooth_box()), obj(ball(centre))]
    channels = picture(*texts, shading=rate)
    hidden = behind_ball(channels, centre)
    assert hidden.sum() > 10
    assert (channels["shadow.sun.Y"][hidden] == 0).all()


def test_what_floats_beside_the_way_to_the_implied_surface_still_shades(picture):
    """The implied surface lies far above the slab's middle; a plate below it, off to the side, shades."""
    plate = np.array([[-0.9, 0.5, -0.4], [-0.1, 0.5, -0.4], [-0.1, 0.5, 0.4], [-0.9, 0.5, 0.4]])
    up = np.tile([0.0, 1.0, 0.0], (4, 1))
    channels = picture(obj(smooth_box()), obj((plate, [[0, 3, 2, 1]], up)))
    p = vectors(channels, "P")
    at = p + (0.5 - p[..., 1:2]) / SUN[1] * SUN
    top = (np.abs(p[..., 1] - TOP) < 1e-4) & (channels["A"] == 1)
    inside = top & (np.abs(at[..., 0] + 0.5) < 0.38) & (np.abs(at[..., 2]) < 0.38)
    assert inside.sum() > 10
    assert (channels["shadow.sun.Y"][inside] == 0).all()


@pytest.mark.parametrize("divisions", [1, 2, 3])
def test_a_coarse_ball_has_no_shadow_on_its_lit_side(picture, divisions):
    channels = picture(obj(ball([0, 0, 0], 1, divisions)), camera=NEAR)
    lit = (vectors(channels, "N") @ SUN > 1e-4) & (channels["A"] == 1)
    assert lit.sum() > 500
    assert (channels["shadow.sun.Y"][lit] == 1).all()


def test_without_the_terminator_the_polygons_cast_their_own_shadow(picture):
    channels = picture(obj(ball([0, 0, 0], 1, 1)), camera=NEAR, terminator="none")
    away = (vectors(channels, "Ng") @ SUN < -0.02) & (vectors(channels, "N") @ SUN > 1e-3)
    assert away.sum() > 10
    assert (channels["shadow.sun.Y"][away] == 0).all()


def test_the_implied_surface_does_not_depend_on_which_samples_were_asked_for_before():
    """Some samples at a time, in more searches than are for the samples asked for alone; or all at once."""
    ball, plate = icosphere(1), Mesh(BOX[:4], np.array([0, 1, 3, 2], np.int32), np.array([0, 4], np.int32))
    geometry = place_meshes([ball, plate], [np.eye(4)] * 2)
    normals = scene_normals(geometry, [corner_normals(mesh) for mesh in (ball, plate)])
    triangle = np.repeat(np.arange(len(geometry.triangles), dtype=np.int32), 9)
    random = np.random.default_rng(0)
    u, v = (0.5 * random.random((2, len(triangle)))).astype(F)
    objects = geometry.objects.take(triangle)
    at = interact(geometry, objects, triangle, u, v, column_major(random.normal(size=(len(triangle), 3)), F))
    weights = corner_weights(geometry, TriangleCorners(None, objects, triangle, u, v))
    context, flat = ShadingContext(geometry, weights, at, normals), [False, True]

    once = smooth_surface(flat, context, SmoothParts(geometry, normals))
    curved = once.curved(np.arange(len(triangle)))
    assert len(triangle) / 3 < len(curved) < len(triangle)
    in_parts = smooth_surface(flat, context, SmoothParts(geometry, normals))
    for part in np.array_split(random.permutation(len(triangle)), 3 * SEARCHES):
        found = part[in_parts.curved(part)]
        assert (np.sort(found) == np.intersect1d(part, curved)).all()
        for name in ("offset", "start", "width"):
            assert (getattr(in_parts, name)[found] == getattr(once, name)[found]).all()


def parts_of(*meshes: Mesh) -> SmoothParts:
    geometry = place_meshes(meshes, [np.eye(4)] * len(meshes))
    return SmoothParts(geometry, scene_normals(geometry, [corner_normals(mesh) for mesh in meshes]))


def test_shadows_at_the_constant_rate_do_not_depend_on_the_rates_of_others(picture):
    corners = np.array([[-2, 0, -2], [-2, 0.4, 2], [2, 0, 2], [2, 0.4, -2]], float)
    twisted = obj((corners, [[0, 1, 2, 3]], np.tile([0.0, 1.0, 0.0], (4, 1))))
    away = {"mesh": "1.obj", "transform": {"translate": [0, 0, -50]}}
    sun = [{"light": "directional", "name": "sun", "direction": [-1, -0.05, 0]}]
    flat = {"mesh": "0.obj", "shading": "constant"}
    shadows = [
        picture(twisted, obj(ball([0, 0, 0])), objects=[flat, {**away, "shading": rate}], lights=sun)
        for rate in ("constant", "phong")
    ]
    assert (shadows[0]["shadow.sun.Y"] == shadows[1]["shadow.sun.Y"]).all()
    assert 0 < shadows[0]["shadow.sun.Y"][shadows[0]["objectId.Y"] == 1].mean() < 1


def test_bodies_of_one_mesh_are_parts_of_their_own():
    one = icosphere(1)
    count = len(one.corners) // 3
    two = Mesh.of_triangles(
        np.concatenate([one.vertices, one.vertices + 3]),
        np.concatenate([one.corners, one.corners + len(one.vertices)]),
    )
    a, b = np.zeros(count * 2, np.int32), np.arange(count * 2, dtype=np.int32)
    np.testing.assert_array_equal(parts_of(two).are_joined(a, b), b < count)


def test_a_seam_that_splits_vertices_does_not_split_the_part():
    one = icosphere(2)
    normals = one.vertices * (1 + 1e-9 * np.arange(len(one.vertices))[:, None])
    split = Mesh.of_triangles(
        one.vertices[one.corners], np.arange(len(one.corners)), normals=normals, corner_normals=one.corners
    )
    b = np.arange(len(one.corners) // 3, dtype=np.int32)
    assert parts_of(split).are_joined(np.zeros_like(b), b).all()


@pytest.mark.parametrize("shared", ["vertices", "normals", "both"])
def test_parts_do_not_depend_on_what_corners_share(shared):
    """Two half spheres with a gap, whose corners are given in three ways."""
    one = icosphere(2)
    triangles = one.corners.reshape(-1, 3)
    height = one.vertices[triangles, 1]
    triangles = triangles[(height > 0.1).all(axis=1) | (height < -0.1).all(axis=1)]
    numbers = np.arange(triangles.size).reshape(-1, 3)
    vertices, corners = (
        (one.vertices, triangles) if shared != "normals" else (one.vertices[triangles], numbers)
    )
    normals, rows = (one.vertices, triangles) if shared != "vertices" else (one.vertices[triangles], numbers)
    if shared == "both":  # a normal of several vertices at vertices of several normals
        normals = np.concatenate([normals, [normals[triangles[0, 0]]]])
        rows = np.where((rows == triangles[0, 0]) & (numbers % 2 == 0), len(normals) - 1, rows)
        vertices = np.concatenate([vertices, [vertices[triangles[0, 0]]]])
        corners = np.where((corners == triangles[0, 0]) & (numbers % 3 == 0), len(vertices) - 1, corners)
    mesh = Mesh.of_triangles(
        vertices.reshape(-1, 3), corners, normals=normals.reshape(-1, 3), corner_normals=rows
    )
    b = np.arange(len(triangles), dtype=np.int32)
    upper = one.vertices[triangles[:, 0], 1] > 0
    np.testing.assert_array_equal(parts_of(mesh).are_joined(np.zeros_like(b), b), upper == upper[0])


def test_objects_that_touch_stay_apart():
    one = icosphere(1)
    b = np.arange(2 * len(one.corners) // 3, dtype=np.int32)
    np.testing.assert_array_equal(parts_of(one, one).are_joined(np.zeros_like(b), b), b < len(b) // 2)


def test_a_creased_edge_parts_the_surfaces_beside_it():
    box = Mesh(BOX, np.ravel(BOX_FACES).astype(np.int32), np.arange(0, 25, 4, dtype=np.int32))
    geometry = place_meshes([box], [np.eye(4)])
    sharp = SmoothParts(geometry, scene_normals(geometry, [corner_normals(box, crease=0.5)]))
    a, b = np.zeros(12, np.int32), np.arange(12, dtype=np.int32)
    np.testing.assert_array_equal(sharp.are_joined(a, b), geometry.polygons == 0)


def test_vertices_of_several_normals_that_several_vertices_share_part_the_surfaces():
    normals = np.array(
        [np.linalg.svd(BOX[list(face)] - BOX[list(face)].mean(axis=0))[2][2] for face in BOX_FACES]
    )
    box = Mesh(
        BOX,
        np.ravel(BOX_FACES).astype(np.int32),
        np.arange(0, 25, 4, dtype=np.int32),
        normals=normals,
        corner_normals=np.repeat(np.arange(6, dtype=np.int32), 4),
    )
    a, b = np.zeros(12, np.int32), np.arange(12, dtype=np.int32)
    np.testing.assert_array_equal(parts_of(box).are_joined(a, b), b < 2)
