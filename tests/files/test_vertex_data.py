"""Baked obscurance in files: what is read is what was written, in the order of the mesh's vertices."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
from plyfile import PlyData

from illumcli.errors import InputError
from illumcli.files import vertex_data
from illumcli.files.vertex_data import (
    Baked,
    Shape,
    add_to_glb,
    fits_single,
    mesh_hash,
    read_content,
    read_npz,
    unit_rows,
    write_glb,
    write_npz,
    write_ply,
)
from illumcli.mesh_files import read_mesh
from illumcli.mesh_files.gltf import primitives_of
from illumcli.mesh_files.gltf.document import open_document

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
ABOUT = {"content": "abc", "vertices": {"a": 4, "b": 4}, "meshes": {"a": "hash a", "b": "hash b"}}


def baked(count=4, bent=False, **about):
    w = np.linspace(0, 1, count, dtype=np.float32)
    normals = np.tile(np.float32([0, 0, 1]), (count, 1)) if bent else None
    return Baked(w, w / 100, normals, about)


def shape(name="a", shift=0.0, **attributes):
    corners, starts = np.arange(4, dtype=np.int32), np.array([0, 4], np.int32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Shape(name, SQUARE + shift, corners, starts, triangles, attributes)


# ------------------------------------------------------------------ npz


@pytest.mark.parametrize("bent", [False, True])
def test_npz_gives_back_what_was_baked(tmp_path, bent):
    write_npz(tmp_path / "a.npz", baked(bent=bent, **ABOUT))
    found = read_npz(tmp_path / "a.npz")
    assert found.obscurance.tolist() == baked().obscurance.tolist()
    assert found.standard_error.tolist() == baked().standard_error.tolist()
    assert (found.bent_normal is not None) == bent
    assert found.about == ABOUT
    assert found.hashes() == ["hash a", "hash b"]
    assert read_content(tmp_path / "a.npz") == "abc"


def test_a_bake_of_several_gives_each_object_its_own_part():
    both = baked(8, vertices={"a": 3, "b": 5})
    assert both.of("anything", 8) is both.obscurance
    assert both.of("a", 3).tolist() == both.obscurance[:3].tolist()
    assert both.of("b", 5).tolist() == both.obscurance[3:].tolist()
    assert both.of("b", 3) is None
    assert both.of("c", 5) is None
    assert Baked(both.obscurance, both.standard_error).hashes() == []


@pytest.mark.parametrize(
    "arrays",
    [
        {"obscurance": [0.5, 1.5], "standard_error": [0, 0]},
        {"obscurance": [0.5, -0.1], "standard_error": [0, 0]},
        {"obscurance": [0.5, np.nan], "standard_error": [0, 0]},
        {"obscurance": [[0.5]], "standard_error": [[0]]},
        {"obscurance": [0.5, 1], "standard_error": [0]},
    ],
)
def test_numbers_that_are_no_obscurance_are_refused(tmp_path, arrays):
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(InputError, match=r"a\.npz: obscurance must be one number from 0 to 1 per vertex"):
        read_npz(tmp_path / "a.npz")


def test_a_bake_without_a_word_about_itself_is_read(tmp_path):
    np.savez(tmp_path / "a.npz", obscurance=[0.0, 1.0], standard_error=[0, 0])
    assert read_npz(tmp_path / "a.npz").about == {}
    assert read_content(tmp_path / "a.npz") is None


def test_files_that_are_no_bake_are_refused_and_have_no_content(tmp_path):
    np.savez(tmp_path / "other.npz", w=[1.0])
    np.savez(tmp_path / "pickled.npz", obscurance=np.array([None]), standard_error=[0])
    for name in ("other.npz", "pickled.npz", "text.npz", "none.npz", "text.glb", "text.ply", "none.ply"):
        path = tmp_path / name
        if name.startswith("text"):
            path.write_text("some text that is long enough for a header")
        if name.endswith(".npz"):
            with pytest.raises(InputError, match=rf"{name}: is no baked obscurance .*bake it with illum"):
                read_npz(path)
        assert read_content(path) is None
    (tmp_path / "number.ply").write_text('ply\ncomment illum {"content": 7}\nend_header\n')
    assert read_content(tmp_path / "number.ply") is None


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
    write_ply(tmp_path / "a.ply", shapes, baked(8, bent=True, **ABOUT), None, None)
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
    assert read_content(tmp_path / "a.ply") == "abc"
    assert read_mesh(tmp_path / "a.ply").polygon_count == 2


def test_ply_of_shapes_keeps_normals_that_all_have(tmp_path):
    normal = np.tile([0.6, 0.0, 0.8], (4, 1))
    write_ply(tmp_path / "a.ply", [shape(normal=normal)], baked(), None, None)
    mesh = read_mesh(tmp_path / "a.ply")
    np.testing.assert_allclose(mesh.normals, normal, rtol=1e-6)


@pytest.mark.parametrize(
    ("channel", "expected"),
    [("r", [85, 255, 255]), ("b", [255, 255, 85]), ("rgb", [85, 85, 85]), ("a", [255, 255, 255])],
)
def test_obscurance_goes_into_the_channel_asked_for(tmp_path, channel, expected):
    write_ply(tmp_path / "a.ply", [shape()], baked(), None, channel)
    row = PlyData.read(tmp_path / "a.ply")["vertex"].data[1]
    assert [row[name] for name in ("red", "green", "blue")] == expected
    assert ("alpha" in row.dtype.names) == (channel == "a")
    if channel == "a":
        assert row["alpha"] == 85


def test_far_from_the_origin_coordinates_keep_double_precision(tmp_path):
    assert fits_single(SQUARE)
    assert not fits_single(SQUARE + 1e6 + 0.3)
    assert fits_single(np.empty((0, 3)))
    write_ply(tmp_path / "a.ply", [shape(shift=1e6 + 0.3)], baked(), None, None)
    assert PlyData.read(tmp_path / "a.ply")["vertex"]["x"].tolist() == (SQUARE[:, 0] + 1e6 + 0.3).tolist()


@pytest.mark.parametrize("count", [255, 256, 300])
def test_polygons_of_more_than_255_corners_are_kept(tmp_path, count):
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    corners, starts = np.arange(count, dtype=np.int32), np.array([0, count], np.int32)
    disc = Shape("disc", circle, corners, starts, np.array([[0, 1, 2]], np.int32), {})
    write_ply(tmp_path / "a.ply", [disc], baked(count), None, None)
    assert read_mesh(tmp_path / "a.ply").corners.tolist() == corners.tolist()


def test_a_ply_is_written_again_with_all_it_has(tmp_path):
    rows = "0 0 0 9 1\n1 0 0 8 2\n1 1 0 7 3\n"
    (tmp_path / "in.ply").write_text(
        "ply\nformat ascii 1.0\ncomment mine\ncomment illum {}\nobj_info kept\nelement vertex 3\n"
        "property float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty int mark\n"
        f"element face 1\nproperty list uchar int vertex_index\nend_header\n{rows}3 0 1 2\n"
    )
    write_ply(tmp_path / "out.ply", [], baked(3, **ABOUT), tmp_path / "in.ply", "g")
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
    write_glb(tmp_path / "a.glb", shapes, baked(8, bent=True, **ABOUT), None)
    mesh = read_mesh(tmp_path / "a.glb")
    assert mesh.group_names == ("a", "b")
    assert mesh.corners.tolist() == [0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7]
    np.testing.assert_allclose(mesh.vertices, np.concatenate([SQUARE, SQUARE + 1e6 + 0.3]), rtol=1e-12)
    np.testing.assert_allclose(mesh.attributes["_OBSCURANCE"], baked(8).obscurance)
    np.testing.assert_allclose(mesh.attributes["_STANDARD_ERROR"], baked(8).standard_error)
    assert mesh.attributes["_BENT_NORMAL"].shape == (8, 3)
    assert mesh.normals[:4].tolist() == [[0, 0, 1], [0, 0, 1], [0, 1, 0], [1, 0, 0]]
    np.testing.assert_allclose(mesh.uvs[:4], SQUARE[:, :2] + 0.25)
    assert read_content(tmp_path / "a.glb") == "abc"
    document, _ = vertex_data._read_glb(tmp_path / "a.glb")
    own = set(document["meshes"][0]["primitives"][0]["attributes"])
    assert {"_MINE", "_HEAT", "COLOR_0"} < {name.upper() for name in own}
    assert "_WIDE" not in own
    assert document["accessors"][0]["max"] == [1, 1, 0]
    assert "translation" not in document["nodes"][0]
    assert document["nodes"][1]["translation"] == pytest.approx([1e6 + 0.8, 1e6 + 0.8, 1e6 + 0.3])


def test_glb_colours_hold_obscurance_where_asked(tmp_path):
    write_glb(tmp_path / "white.glb", [shape()], baked(), "b")
    color = read_mesh(tmp_path / "white.glb").attributes["color"]
    np.testing.assert_allclose(color[1], [1, 1, 85 / 255], rtol=1e-6)
    color = np.tile([1.0, 0.0, 0.0], (4, 1))
    write_glb(tmp_path / "a.glb", [shape(color=color)], baked(), "b")
    mesh = read_mesh(tmp_path / "a.glb")
    np.testing.assert_allclose(mesh.attributes["color"][1], [1, 0, 85 / 255], rtol=1e-6)
    assert mesh.attributes["alpha"].tolist() == [1, 1, 1, 1]


def test_a_glb_is_written_again_with_all_it_has(tmp_path):
    write_glb(tmp_path / "in.glb", [shape("a"), shape("b", 3.0)], baked(8), None)
    document, data = vertex_data._read_glb(tmp_path / "in.glb")
    document["extras"] = {"mine": 1}
    vertex_data._Buffer(document, data).write(tmp_path / "in.glb")
    opened = open_document(tmp_path / "in.glb")
    counts = primitives_of(opened)
    assert counts == [(0, 0, 4), (1, 0, 4)]
    again = Baked(baked(8).obscurance[::-1], baked(8).standard_error, None, ABOUT)
    add_to_glb(tmp_path / "out.glb", (opened.json, opened.chunk or b""), counts, again)
    mesh = read_mesh(tmp_path / "out.glb")
    np.testing.assert_allclose(mesh.attributes["_OBSCURANCE"], again.obscurance)
    np.testing.assert_array_equal(mesh.vertices, read_mesh(tmp_path / "in.glb").vertices)
    assert vertex_data._read_glb(tmp_path / "out.glb")[0]["extras"] == {"mine": 1}
    assert read_content(tmp_path / "out.glb") == "abc"


def test_a_glb_needs_no_binary_chunk_and_a_json_one(tmp_path):
    text = b'{"asset": {}}   '
    (tmp_path / "a.glb").write_bytes(struct.pack("<4sIIII", b"glTF", 2, 36, 16, 0x4E4F534A) + text)
    assert vertex_data._read_glb(tmp_path / "a.glb") == ({"asset": {}}, b"")
    (tmp_path / "b.glb").write_bytes(struct.pack("<4sIIII", b"glTF", 2, 36, 16, 7) + text)
    with pytest.raises(InputError, match=r"b\.glb: is no GLB"):
        vertex_data._read_glb(tmp_path / "b.glb")


# ------------------------------------------------------------------ arithmetic


def test_the_hash_of_a_mesh_is_that_of_its_geometry():
    corners, starts = np.arange(4, dtype=np.int32), np.array([0, 4], np.int32)
    own = mesh_hash(SQUARE, corners, starts)
    assert own == mesh_hash(np.asfortranarray(SQUARE), corners.copy(), starts)
    assert len(own) == 32
    assert own != mesh_hash(SQUARE + 1e-12, corners, starts)
    assert own != mesh_hash(SQUARE, corners[::-1].copy(), starts)
    assert own != mesh_hash(SQUARE, corners, np.array([0, 3], np.int32))


def test_unit_rows_have_length_one_and_zero_points_up():
    rows = unit_rows(np.array([[3.0, 0, 4], [0, 0, 0]]))
    np.testing.assert_allclose(rows, [[0.6, 0, 0.8], [0, 0, 1]])
