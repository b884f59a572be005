"""`illum render MESH`: all of the mesh is in the picture, as its file says it looks, above a floor."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render import render_scene
from illumcli.errors import InputError
from illumcli.images.reader import read_image
from illumcli.images.writer import ImageWriter
from illumcli.models.blinn_phong import BlinnPhong
from illumcli.rays.camera import MARGIN
from illumcli.scene.load import load
from illumcli.scene.spec import Scene
from illumcli.scene.studio import ROTATIONS
from illumcli.shading.materials import as_intended

SMALL = ["film={width: 80, height: 45, samples: 1}"]
BOX = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)


def obj(path, vertices, faces, more=""):
    """Write an OBJ file; faces count from 0, or are lines as they stand."""
    lines = [f"v {' '.join(map(repr, map(float, vertex)))}" for vertex in vertices]
    lines += [face if isinstance(face, str) else "f " + " ".join(str(k + 1) for k in face) for face in faces]
    path.write_text(more + "\n".join(lines) + "\n")
    return path


def layers(path, *overrides, only=("object_id",), film=SMALL):
    """Channels of a picture of a bare mesh, and the report."""
    out = path.parent / "out.exr"
    _, report = render_scene(
        RenderJob(
            path,
            RenderOptions(
                [*film, "outputs.colour=float", *overrides], str(out), only, force=True, cache=False
            ),
        )
    )
    return read_image(out).channels, report


def box_of(ids, number=1):
    """First and last row, first and last column of an object's pixels."""
    return [(int(each.min()), int(each.max())) for each in np.nonzero(ids == number)]


SHAPES = {
    "cube": np.eye(3),
    "pole": np.diag([0.03, 1, 0.03]),
    "needle": np.diag([1, 0.02, 0.02]),
    "plate": np.diag([1, 0.02, 1]),
    "huge": np.eye(3) * 1e9,
    "tiny": np.eye(3) * 1e-9,
}


@pytest.mark.parametrize("away", [0.0, 1000.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_all_of_any_mesh_is_in_the_picture_and_fills_it(tmp_path, shape, away):
    size = np.abs(SHAPES[shape]).max()
    path = obj(tmp_path / "m.obj", CORNERS @ SHAPES[shape] + away * size, BOX)
    rows, columns = box_of(layers(path)[0]["objectId.Y"])
    filled = max((rows[1] - rows[0] + 1) / 45, (columns[1] - columns[0] + 1) / 80)
    assert filled == pytest.approx(1 - MARGIN, abs=0.05)
    assert rows[0] + rows[1] == pytest.approx(44, abs=2)
    assert columns[0] + columns[1] == pytest.approx(79, abs=2)


def test_a_flat_mesh_on_the_floor_is_clean(tmp_path):
    path = obj(tmp_path / "m.obj", [(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)], [(0, 1, 2, 3)])
    found, _ = layers(
        path, only=("object_id", "obscurance"), film=["film={width: 160, height: 90, samples: 1}"]
    )
    seen = found["objectId.Y"] == 1
    rows = np.flatnonzero(seen.any(axis=1))
    for row in rows:  # no hole in any row: nothing of the floor shines through
        own = np.flatnonzero(seen[row])
        assert len(own) == own[-1] - own[0] + 1
    inside = seen & np.roll(seen, 2, 0) & np.roll(seen, -2, 0) & np.roll(seen, 2, 1) & np.roll(seen, -2, 1)
    assert (found["obscurance.Y"][inside] == 1).all()


def test_the_floor_is_a_little_lower(tmp_path):
    path = obj(tmp_path / "m.obj", CORNERS, BOX)
    found, _ = layers(path, only=("object_id", "position"))
    floor = found["P.Y"][found["objectId.Y"] == 2]
    own = found["P.Y"][found["objectId.Y"] == 1]
    assert -0.01 < floor.max() < 0 <= own.min() + 1e-6


# from where


def shown(path, *overrides):
    """Where three balls along +x, +y and +z are in the picture: their columns and rows."""
    found, _ = layers(path, *overrides, only=("object_id", "triangle_id"))
    triangle = found["triangleId.Y"]
    own = found["objectId.Y"] == 1
    faces = len(BOX) * 2
    return [tuple(np.mean(np.nonzero(own & ((triangle - 1) // faces == k)), axis=1)[::-1]) for k in range(3)]


@pytest.fixture
def axes(tmp_path):
    """Three cubes away from the origin: on +x, on +y, on +z."""
    vertices, faces = [], []
    for axis in range(3):
        faces += [tuple(len(vertices) + k for k in face) for face in BOX]
        vertices += list(CORNERS * 0.2 + 1.5 * np.eye(3)[axis])
    return obj(tmp_path / "axes.obj", vertices, faces)


@pytest.mark.parametrize(
    ("view", "right", "up"),
    [
        ("[0, 0]", "x", "y"),  # from +z
        ("[90, 0]", "-z", "y"),  # from +x
        ("[180, 0]", "-x", "y"),
        ("[0, 90]", "x", "-z"),  # from above
        ("[90, 90]", "-z", "-x"),
        ("[0, -90]", "x", "z"),
    ],
)
def test_a_view_is_azimuth_and_elevation(axes, view, right, up):
    places = np.array(shown(axes, f"studio.view={view}"))
    signs = {name: (-1 if name.startswith("-") else 1) for name in (right, up)}
    own = {name: "xyz".index(name[-1]) for name in (right, up)}
    others = [k for k in range(3) if k != own[right]]
    assert all(signs[right] * (places[own[right], 0] - places[k, 0]) > 5 for k in others)
    others = [k for k in range(3) if k != own[up]]
    assert all(signs[up] * (places[k, 1] - places[own[up], 1]) > 5 for k in others)


@pytest.mark.parametrize("up", ROTATIONS)
def test_any_axis_may_point_up(axes, up):
    found, _ = layers(axes, f"studio.up={up}", only=("object_id", "triangle_id", "position"))
    own = found["objectId.Y"] == 1
    heights = [
        found["P.Y"][own & ((found["triangleId.Y"] - 1) // (2 * len(BOX)) == k)].mean() for k in range(3)
    ]
    axis = "xyz".index(up[-1])
    others = [heights[k] for k in range(3) if k != axis]
    assert all(heights[axis] > other for other in others) != up.startswith("-")
    assert others[0] == pytest.approx(others[1], abs=0.2)


def test_the_default_view_is_24_13(axes):
    plain, said = shown(axes), shown(axes, "studio.view=[24, 13]")
    np.testing.assert_allclose(plain, said, atol=0.5)


def test_the_lights_go_around_with_the_view(tmp_path):
    ball = load(obj(tmp_path / "m.obj", CORNERS, BOX), ["studio.view=[114, 13]"]).scene
    plain = load(tmp_path / "m.obj").scene
    for turned, light in zip(ball.lights, plain.lights, strict=True):
        x, y, z = light.position
        assert turned.position == pytest.approx((z, y, -x), abs=0.01)  # by a quarter, from z to x


def test_nothing_stands_between_the_mesh_and_a_camera_below(tmp_path):
    found, _ = layers(obj(tmp_path / "m.obj", CORNERS, BOX), "studio.view=[0, -20]")
    assert set(np.unique(found["objectId.Y"])) == {0, 1}


def test_overrides_are_put_on_top_of_the_view(tmp_path):
    path = obj(tmp_path / "m.obj", CORNERS, BOX)
    words = ["camera.position=[0,5,0]", "studio.view=[90, 0]", "studio.up=z"]
    scene = load(path, [*words, "objects.subject.transform.rotate=[1, 2, 3]"]).scene
    assert scene.camera.position == (0, 5, 0)
    assert scene.objects[0].transform.rotate == (1, 2, 3)


@pytest.mark.parametrize(
    ("said", "fact"),
    [
        ("studio.view=[0, 91]", "1: must be at most 90, is 91"),
        ("studio.view=5", "must be a list, is 5"),
        ("studio.up=w", "no choice 'w'; there are: x, y, z, -x, -y, -z"),
        ("studio.vieww=[0, 0]", "unknown key 'vieww'; did you mean 'view'?"),
    ],
)
def test_what_is_wrong_with_a_view_is_told(tmp_path, said, fact):
    with pytest.raises(InputError) as caught:
        load(obj(tmp_path / "m.obj", CORNERS, BOX), [said])
    assert caught.value.problems == (f"-D {said}: {fact}",)


def test_a_scene_has_no_view_of_the_studio(tmp_path):
    (tmp_path / "s.yaml").write_text("version: 1\n")
    with pytest.raises(InputError, match=r"s.yaml is not a mesh file; change its camera"):
        load(tmp_path / "s.yaml", ["studio.up=z"])


@pytest.mark.parametrize("words", [["render"], ["plan"], ["check"], ["sweep", "-D", "film.samples=1"]])
def test_commands_that_take_a_mesh_take_a_view(illum, tmp_path, words):
    obj(tmp_path / "m.obj", CORNERS, BOX)
    small = ["-D", SMALL[0]]
    done = illum(*words, "m.obj", *small, "--view", "-30,10", "--up", "-z")
    assert done.returncode == 0, done.stderr
    done = illum(*words, "m.obj", *small, "--view", "30")
    assert done.returncode == 2
    assert "'30' is not AZIMUTH,ELEVATION; write it as 24,13" in done.stderr


# how it looks


def color_at_centre(path, *overrides):
    """The colour of ambient light alone in the middle of the picture, over the ambient light."""
    words = ["ambient=1", "obscurance=null", "lights=[]", *overrides]
    found, _ = layers(path, *words, only=("beauty",))
    return np.array([found[c][22, 40] for c in "RGB"])


OWN = (0.9, 0.85, 0.775)


def test_a_mesh_without_materials_has_the_studios(tmp_path):
    path = obj(tmp_path / "m.obj", CORNERS, BOX)
    np.testing.assert_allclose(color_at_centre(path), OWN, rtol=1e-5)
    np.testing.assert_allclose(color_at_centre(path, "materials.subject.diffuse=#f00"), (1, 0, 0), rtol=1e-5)
    np.testing.assert_allclose(
        color_at_centre(path, "objects.subject.material={model: lambert, diffuse: 0.25}"), 0.25, rtol=1e-5
    )


def test_a_mesh_has_the_materials_of_its_library(tmp_path):
    (tmp_path / "m.mtl").write_text("newmtl floor\nKd 0.2 0.4 0.6\n")
    path = obj(tmp_path / "m.obj", CORNERS, BOX, "mtllib m.mtl\nusemtl floor\n")
    np.testing.assert_allclose(color_at_centre(path), (0.2, 0.4, 0.6), rtol=1e-5)
    np.testing.assert_allclose(
        color_at_centre(path, "objects.subject.material=floor"), (0.9, 0.9, 0.925), rtol=1e-5
    )


def test_what_the_library_does_not_describe_has_the_studios(tmp_path):
    (tmp_path / "m.mtl").write_text("newmtl red\nKd 1 0 0\n")
    path = obj(tmp_path / "m.obj", CORNERS, BOX, "mtllib m.mtl\nusemtl floor\n")
    np.testing.assert_allclose(color_at_centre(path), OWN, rtol=1e-5)


def test_a_mesh_has_its_textures(tmp_path):
    with ImageWriter(tmp_path / "t.png", 4, 4, dict.fromkeys("RGB", "uint8"), {}) as file:
        file.write_band(0, np.broadcast_to(np.array([0, 188, 0], np.uint8), (4, 4, 3)))
    (tmp_path / "m.mtl").write_text("newmtl cover\nmap_Kd t.png\n")
    path = obj(
        tmp_path / "m.obj",
        [(-1, 0, -1), (-1, 0, 1), (1, 0, 1), (1, 0, -1)],
        ["vt 0 0\nvt 1 1\nusemtl cover\nf 1/1 2/2 3/1 4/2"],
        "mtllib m.mtl\n",
    )
    assert color_at_centre(path) == pytest.approx([0, ((188 / 255 + 0.055) / 1.055) ** 2.4, 0], rel=1e-4)


def test_a_mesh_has_its_vertex_colours(tmp_path):
    lines = [f"v {x} {y} {z} 0 1 0" for x, y, z in CORNERS]
    path = obj(tmp_path / "m.obj", [], BOX, "\n".join(lines) + "\n")
    np.testing.assert_allclose(color_at_centre(path), (0, 1, 0), atol=1e-6)


def test_a_ply_has_its_vertex_colours(tmp_path):
    rows = [f"{x} {y} {z} 255 0 0" for x, y, z in CORNERS]
    faces = ["4 " + " ".join(map(str, face)) for face in BOX]
    head = "ply\nformat ascii 1.0\nelement vertex 8\n" + "".join(f"property float {a}\n" for a in "xyz")
    head += "".join(f"property uchar {c}\n" for c in ("red", "green", "blue"))
    head += "element face 6\nproperty list uchar int vertex_indices\nend_header\n"
    path = tmp_path / "m.ply"
    path.write_text(head + "\n".join([*rows, *faces]) + "\n")
    np.testing.assert_allclose(color_at_centre(path), (1, 0, 0), atol=1e-6)


def test_what_exporters_write_for_nothing_is_not_shown(tmp_path):
    """Ambient colours of white, and a highlight of exponent 0, would wash the texture out."""
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 0.5 0 0\nKa 1 1 1\nKs 1 1 1\nNs 0\n")
    path = obj(tmp_path / "m.obj", CORNERS, BOX, "mtllib m.mtl\nusemtl a\n")
    np.testing.assert_allclose(color_at_centre(path), (0.5, 0, 0), rtol=1e-5)
    found, _ = layers(path, only=("specular",))
    assert not found["specular.R"].any()


def test_the_lights_are_the_same_to_every_format(tmp_path):
    """Kd of MTL, the studio's own diffuse colour and the albedo of a physical model look alike."""
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 0.5 0.5 0.5\n")
    obj(tmp_path / "plain.obj", CORNERS, BOX)
    path = obj(tmp_path / "m.obj", CORNERS, BOX, "mtllib m.mtl\nusemtl a\n")
    own = ["materials.subject.diffuse=0.5", "materials.subject.specular=0"]
    lambert = "objects.subject.material={model: lambert, diffuse: 0.5}"
    found = [layers(path, only=("beauty",))[0], layers(tmp_path / "plain.obj", *own, only=("beauty",))[0]]
    expected = layers(path, lambert, only=("beauty",))[0]
    assert expected["R"][22, 40] > 0.2
    for each in found:
        np.testing.assert_allclose(each["G"], expected["G"], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("exponent", [1, 30, 1000])
def test_a_highlight_of_mtl_has_the_middle_it_says(exponent):
    """Under the studio's lights, pi times as strong as those of the texts."""
    mtl = BlinnPhong.model_validate({"model": "blinn_phong", "specular": [0.2, 0.5, 1], "exponent": exponent})
    n_l, gap = np.ones(1), np.zeros(1)
    np.testing.assert_allclose(
        np.pi * as_intended(mtl).specular_lobe(n_l, gap), mtl.specular_lobe(n_l, gap), rtol=1e-12
    )


def test_a_scene_may_fall_back_too(tmp_path):
    obj(tmp_path / "m.obj", CORNERS, BOX, "")
    (tmp_path / "s.yaml").write_text(
        "version: 1\nambient: 1\ncamera: {position: [0, 0, 9], target: [0, 0, 0]}\n"
        "materials: {clay: {model: lambert, diffuse: [0.1, 0.2, 0.3]}}\n"
        "objects: [{mesh: m.obj, fallback: clay}]\n"
    )
    found, _ = layers(tmp_path / "s.yaml", only=("beauty",))
    assert [found[c][22, 40] for c in "RGB"] == pytest.approx([0.1, 0.2, 0.3], rel=1e-5)
    with pytest.raises(InputError, match="fallback=clayy: no material 'clayy'; did you mean 'clay'"):
        load(tmp_path / "s.yaml", ["objects.0.fallback=clayy"])
    with pytest.raises(ValidationError):
        Scene.model_validate({"version": 1, "objects": [{"mesh": "a.obj", "fallback": "none"}]})


def test_faults_of_the_mesh_name_its_file(illum, tmp_path):
    (tmp_path / "m.obj").write_text("v 0 0 0\nf 1 2 3\n")
    done = illum("render", "m.obj")
    assert done.returncode == 2
    assert done.stderr.startswith("m.obj:2: index 2 is out of range")


def test_what_the_studio_says_without_effect_is_not_told(illum, tmp_path):
    obj(tmp_path / "m.obj", CORNERS, BOX)
    words = ["-D", SMALL[0], "-D", "ambient=0", "-D", "objects.subject.material=floor"]
    done = illum("render", "m.obj", *words)
    assert (done.returncode, done.stderr) == (0, "")
