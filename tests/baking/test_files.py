"""Files of a bake: the values of all objects, vertex by vertex, as PLY and GLB, and the content they name."""

from __future__ import annotations

import json

import numpy as np
import pytest
from plyfile import PlyData

from baked_values import ABOUT, SQUARE, baked
from illumcli.baking.files import add_baked_to_glb, baked_contents, write_baked_glb, write_baked_ply
from illumcli.errors import InputError
from illumcli.mesh_files import read_mesh
from illumcli.mesh_files.gltf.document import open_document
from illumcli.mesh_files.gltf.glb_writer import GlbWriter
from illumcli.mesh_files.output_mesh import OutputMesh
from illumcli.visibility.baked import Baked, write_npz


def shape(name="a", shift=0.0, **attributes):
    corners, starts = np.arange(4, dtype=np.int32), np.array([0, 4], np.int32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return OutputMesh(name, SQUARE + shift, corners, starts, triangles, attributes)


# ------------------------------------------------------------------ content


def test_every_format_names_its_content(tmp_path):
    write_npz(tmp_path / "a.npz", baked(**ABOUT))
    write_baked_ply(tmp_path / "a.ply", [shape()], baked(**ABOUT), None, None)
    write_baked_glb(tmp_path / "a.glb", [shape()], baked(**ABOUT), None)
    for name in ("a.npz", "a.ply", "a.glb"):
        assert baked_contents(tmp_path / name) == ["abc"]


def test_files_that_are_no_bake_have_no_content(tmp_path):
    np.savez(tmp_path / "other.npz", w=[1.0])
    np.savez(tmp_path / "pickled.npz", obscurance=np.array([None]), standard_error=[0])
    np.savez(tmp_path / "silent.npz", obscurance=[0.0, 1.0], standard_error=[0, 0])
    (tmp_path / "number.ply").write_text('ply\ncomment illum {"content": 7}\nend_header\n')
    for name in ("text.npz", "text.glb", "text.ply", "text.txt"):
        (tmp_path / name).write_text("some text that is long enough for a header")
    names = [*(path.name for path in tmp_path.iterdir()), "none.npz", "none.ply", "none.glb"]
    for name in names:
        with pytest.raises(InputError, match=rf"{name}: .*bake it with illum ao-bake"):
            baked_contents(tmp_path / name)


# ------------------------------------------------------------------ PLY


def test_ply_of_shapes_holds_them_one_after_the_other(tmp_path):
    normal, uv = np.tile([0.0, 0, 1], (4, 1)), SQUARE[:, :2]
    color = np.tile([1.0, 0.0, 0.0031308], (4, 1))
    rest = {
        "uv": uv,
        "color": color,
        "heat": np.arange(4.0),
        "flow": uv,
        "count": np.arange(4, dtype=np.int32),
    }
    shapes = [shape("a", normal=normal, alone=uv, odd=uv, **rest), shape("b", 2.0, odd=normal, **rest)]
    write_baked_ply(tmp_path / "a.ply", shapes, baked(8, bent=True, **ABOUT), None, None)
    made = PlyData.read(tmp_path / "a.ply")
    table = made["vertex"].data
    assert table["x"].tolist() == [0, 1, 1, 0, 2, 3, 3, 2]
    assert table["obscurance"].tolist() == table["quality"].tolist() == baked(8).obscurance.tolist()
    assert table["standard_error"].tolist() == baked(8).standard_error.tolist()
    assert table["nz_bent"].tolist() == [1.0] * 8
    assert table["red"].tolist() == [255] * 8
    assert table["blue"].tolist() == [10] * 8
    assert table["s"].tolist() == [0, 1, 1, 0] * 2
    assert table["heat"].tolist() == [0, 1, 2, 3] * 2
    assert table["flow_1"].tolist() == [0, 0, 1, 1] * 2
    assert table["count"].dtype.kind == "i"
    assert not {"nx", "alone", "alone_0", "odd", "odd_0"} & set(table.dtype.names)
    assert [row.tolist() for row in made["face"]["vertex_indices"]] == [[0, 1, 2, 3], [4, 5, 6, 7]]
    assert read_mesh(tmp_path / "a.ply").polygon_count == 2


def test_ply_of_shapes_keeps_normals_that_all_have(tmp_path):
    normal = np.tile([0.6, 0.0, 0.8], (4, 1))
    write_baked_ply(tmp_path / "a.ply", [shape(normal=normal)], baked(), None, None)
    mesh = read_mesh(tmp_path / "a.ply")
    np.testing.assert_allclose(mesh.normals, normal, rtol=1e-6)


@pytest.mark.parametrize(
    ("channel", "expected"),
    [("r", [85, 255, 255]), ("b", [255, 255, 85]), ("replace", [156, 156, 156]), ("a", [255, 255, 255])],
)
def test_obscurance_goes_into_the_channel_asked_for(tmp_path, channel, expected):
    write_baked_ply(tmp_path / "a.ply", [shape()], baked(), None, channel)
    row = PlyData.read(tmp_path / "a.ply")["vertex"].data[1]
    assert [row[name] for name in ("red", "green", "blue")] == expected
    assert ("alpha" in row.dtype.names) == (channel == "a")
    if channel == "a":
        assert row["alpha"] == 85


def test_far_from_the_origin_coordinates_keep_double_precision(tmp_path):
    write_baked_ply(tmp_path / "a.ply", [shape(shift=1e6 + 0.3)], baked(), None, None)
    assert PlyData.read(tmp_path / "a.ply")["vertex"]["x"].tolist() == (SQUARE[:, 0] + 1e6 + 0.3).tolist()


@pytest.mark.parametrize("count", [255, 256, 300])
def test_polygons_of_more_than_255_corners_are_kept(tmp_path, count):
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    corners, starts = np.arange(count, dtype=np.int32), np.array([0, count], np.int32)
    disc = OutputMesh("disc", circle, corners, starts, np.array([[0, 1, 2]], np.int32), {})
    write_baked_ply(tmp_path / "a.ply", [disc], baked(count), None, None)
    assert read_mesh(tmp_path / "a.ply").corners.tolist() == corners.tolist()


def test_a_ply_is_written_again_with_all_it_has(tmp_path):
    rows = "0 0 0 9 1\n1 0 0 8 2\n1 1 0 7 3\n"
    (tmp_path / "in.ply").write_text(
        "ply\nformat ascii 1.0\ncomment mine\ncomment illum {}\nobj_info kept\nelement vertex 3\n"
        "property float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty int mark\n"
        f"element face 1\nproperty list uchar int vertex_index\nend_header\n{rows}3 0 1 2\n"
    )
    write_baked_ply(tmp_path / "out.ply", [], baked(3, **ABOUT), tmp_path / "in.ply", "g")
    made = PlyData.read(tmp_path / "out.ply")
    assert made.text
    assert made.comments[0] == "mine"
    about = json.loads(made.comments[1].removeprefix("illum "))
    assert about.pop("body").startswith("illum-body:")
    assert about == ABOUT
    assert made.obj_info == ["kept"]
    table = made["vertex"].data
    assert table["mark"].tolist() == [1, 2, 3]
    assert table["red"].tolist() == [9, 8, 7]
    assert table["green"].tolist() == [0, 128, 255]
    assert table["blue"].tolist() == [255, 255, 255]
    assert table["obscurance"].tolist() == [0, 0.5, 1]
    assert made["face"]["vertex_index"][0].tolist() == [0, 1, 2]


# ------------------------------------------------------------------ GLB


def test_glb_holds_every_shape_and_its_values(tmp_path):
    color = np.tile([0.25, 0.5, 1.0], (4, 1))
    normal = np.array([[0, 0, 2.0], [0, 0, 0], [0, 3, 0], [1, 0, 0]])
    rest = {"normal": normal, "color": color, "uv": SQUARE[:, :2] + 0.25, "heat": np.arange(4.0)}
    shapes = [shape("a", _mine=np.arange(4.0), wide=np.ones((4, 7)), **rest), shape("b", 1e6 + 0.3)]
    write_baked_glb(tmp_path / "a.glb", shapes, baked(8, bent=True, **ABOUT), None)
    mesh = read_mesh(tmp_path / "a.glb")
    assert mesh.group_names == ("a", "b")
    assert mesh.corners.tolist() == [0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7]
    np.testing.assert_allclose(mesh.vertices, np.concatenate([SQUARE, SQUARE + 1e6 + 0.3]), rtol=1e-12)
    np.testing.assert_allclose(mesh.attributes["_OBSCURANCE"], baked(8).obscurance)
    np.testing.assert_allclose(mesh.attributes["_STANDARD_ERROR"], baked(8).standard_error)
    assert mesh.attributes["_BENT_NORMAL"].shape == (8, 3)
    assert mesh.normals[:4].tolist() == [[0, 0, 1], [0, 0, 1], [0, 1, 0], [1, 0, 0]]
    np.testing.assert_allclose(mesh.uvs[:4], SQUARE[:, :2] + 0.25)
    document = open_document(tmp_path / "a.glb").json
    own = set(document["meshes"][0]["primitives"][0]["attributes"])
    assert {"_MINE", "_HEAT", "COLOR_0"} < {name.upper() for name in own}
    assert "_WIDE" not in own
    assert document["accessors"][0]["max"] == [1, 1, 0]
    assert "translation" not in document["nodes"][0]
    assert document["nodes"][1]["translation"] == pytest.approx([1e6 + 0.8, 1e6 + 0.8, 1e6 + 0.3])


def test_glb_colours_hold_obscurance_where_asked(tmp_path):
    write_baked_glb(tmp_path / "white.glb", [shape()], baked(), "b")
    color = read_mesh(tmp_path / "white.glb").attributes["color"]
    np.testing.assert_allclose(color[1], [1, 1, 85 / 255], rtol=1e-6)
    color = np.tile([1.0, 0.0, 0.0], (4, 1))
    write_baked_glb(tmp_path / "a.glb", [shape(color=color)], baked(), "b")
    mesh = read_mesh(tmp_path / "a.glb")
    np.testing.assert_allclose(mesh.attributes["color"][1], [1, 0, 85 / 255], rtol=1e-6)
    assert mesh.attributes["alpha"].tolist() == [1, 1, 1, 1]


def test_a_glb_is_written_again_with_all_it_has(tmp_path):
    write_baked_glb(tmp_path / "in.glb", [shape("a"), shape("b", 3.0)], baked(8), None)
    plain = open_document(tmp_path / "in.glb")
    GlbWriter({**plain.json, "extras": {"mine": 1}}, plain.chunk).write(tmp_path / "in.glb")
    again = Baked({**baked(8).channels, "obscurance": baked(8).obscurance[::-1]}, ABOUT)
    assert add_baked_to_glb(tmp_path / "out.glb", tmp_path / "in.glb", again, None) == []
    mesh = read_mesh(tmp_path / "out.glb")
    np.testing.assert_allclose(mesh.attributes["_OBSCURANCE"], again.obscurance)
    np.testing.assert_array_equal(mesh.vertices, read_mesh(tmp_path / "in.glb").vertices)
    assert open_document(tmp_path / "out.glb").json["extras"] == {"mine": 1}
