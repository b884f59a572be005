from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from illumcli.errors import InputError, LimitError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.repairs import HARMLESS
from illumcli.mesh_files import read_mesh
from illumcli.mesh_files.gltf import primitives

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "f4")


def counted(mesh: Mesh) -> dict[str, int]:
    """The counts of the mesh's repairs, without harmless ones."""
    return {what: each.count for what, each in mesh.repairs.items() if what not in HARMLESS}


def triangles(mesh: Mesh) -> list[list[int]]:
    return mesh.corners.reshape(-1, 3).tolist()


@pytest.mark.parametrize("suffix", [".gltf", ".glb"])
def test_triangles_of_both_kinds_of_file(tmp_path: Path, suffix: str, square: Any) -> None:
    mesh = read_mesh(square().write(tmp_path / f"a{suffix}"))
    assert mesh.vertices.tolist() == CORNERS.tolist()
    assert triangles(mesh) == [[0, 1, 2], [0, 2, 3]]
    assert mesh.normals is None
    assert mesh.uvs is None
    assert mesh.material_names == ()
    assert counted(mesh) == {}


def test_buffers_may_be_files_beside(tmp_path: Path, square: Any) -> None:
    scene = square()
    (tmp_path / "my data.bin").write_bytes(scene.data)
    assert read_mesh(scene.write(tmp_path / "a.gltf", uri="my%20data.bin")).polygon_count == 2


@pytest.mark.parametrize("uri", ["../x.bin", "/etc/passwd", "link.bin", "%2e%2e/x.bin"])
def test_buffers_outside_the_folder_are_refused(tmp_path: Path, uri: str, square: Any) -> None:
    folder = tmp_path / "meshes"
    folder.mkdir()
    scene = square()
    (tmp_path / "x.bin").write_bytes(scene.data)
    (folder / "link.bin").symlink_to(tmp_path / "x.bin")
    with pytest.raises(InputError, match=r"leads out of the folder|absolute path"):
        read_mesh(scene.write(folder / "a.gltf", uri=uri))


def test_buffers_that_cannot_be_read_are_refused(tmp_path: Path, square: Any) -> None:
    os.mkfifo(tmp_path / "fifo.bin")
    for uri, message in [
        ("fifo.bin", "no regular file"),
        ("absent.bin", "no such file"),
        ("http://example.org/a.bin", "on the network"),
        ("data:application/octet-stream;base64,????", "no readable data URI"),
        ("data:application/octet-stream;base64,AAA\u07f6", "no readable data URI"),
        ("data:,\ud800", "ends at byte 48 of its buffer, which has 1"),
        ("\ud800.bin", "no usable path|cannot be read"),
        ("data:application/octet-stream;base64,AAAA", "ends at byte 48 of its buffer, which has 3"),
    ]:
        with pytest.raises(InputError, match=message):
            read_mesh(square().write(tmp_path / "a.gltf", uri=uri))


def test_strips_fans_and_loose_corners(tmp_path: Path, Scene: Any) -> None:
    scene = Scene()
    scene.primitive([0, 1, 3, 2], mode=5)
    scene.primitive([0, 1, 2, 3], mode=6)
    scene.primitive([0, 1], mode=6)
    scene.primitive([0, 1], mode=1)
    loose = scene.primitive()
    loose["attributes"]["POSITION"] = scene.table(CORNERS[:3])
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert triangles(mesh) == [[0, 1, 3], [3, 1, 2], [4, 5, 6], [4, 6, 7], [12, 13, 14]]
    assert counted(mesh) == {"primitives of points or lines left out": 1}


def test_nodes_place_their_meshes(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = scene.table([[0, 0.6, 0.8]] * 4)
    half = np.sqrt(0.5)
    scene.json["scenes"] = [{"nodes": []}, {"nodes": [3, 1]}]
    scene.json["scene"] = 1
    scene.json["nodes"] = [
        {"mesh": 0, "rotation": [0, 0, half, half], "scale": [1, 2, 1], "name": "turned"},
        {"translation": [10, 0, 0], "children": [0, 2]},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1]},
        {"mesh": 0},
        {"mesh": 0, "name": "of no scene"},
    ]
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.normals is not None
    plain, turned, mirrored = mesh.vertices.reshape(3, 4, 3)
    np.testing.assert_array_equal(plain, CORNERS)
    np.testing.assert_allclose(turned, [[10, 0, 0], [10, 1, 0], [8, 1, 0], [8, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(mirrored, CORNERS * [1, -1, 1] + [10, 0, 5])
    assert triangles(mesh)[4:] == [[10, 9, 8], [11, 10, 8]]  # turned back, so that outside stays outside
    normals = mesh.normals[[0, 4, 8]] / np.linalg.norm(mesh.normals[[0, 4, 8]], axis=1)[:, None]
    expected = np.array([[0, 0.6, 0.8], [-0.3, 0, 0.8], [0, -0.6, 0.8]])
    np.testing.assert_allclose(normals, expected / np.linalg.norm(expected, axis=1)[:, None], atol=1e-7)
    assert mesh.group_names == ("node 3", "turned", "node 2")
    assert mesh.polygon_groups is not None
    assert mesh.polygon_groups.tolist() == [0, 0, 1, 1, 2, 2]


def test_without_scenes_every_node_without_a_parent_is_a_root(tmp_path: Path, square: Any) -> None:
    scene = square()
    del scene.json["scenes"], scene.json["scene"]
    scene.json["nodes"] = [{"mesh": 0}, {"children": [0], "translation": [0, 0, 7]}]
    assert read_mesh(scene.write(tmp_path / "a.glb")).vertices[0].tolist() == [0, 0, 7]


def test_attributes_of_vertices(tmp_path: Path, Scene: Any) -> None:
    scene = Scene()
    first = scene.primitive(
        [0, 1, 2],
        TEXCOORD_0=scene.table([[0, 0], [255, 0], [255, 51], [0, 0]], "u1", normalized=True),
        COLOR_0=scene.table([[1, 0.5, 0, 0.25]] * 4),
        _OBSCURANCE=scene.table([0.1, 0.2, 0.3, 0.4]),
        _ONCE=scene.table([[1, 2]] * 4),
    )
    second = scene.primitive([0, 1, 2], _OBSCURANCE=scene.table([1, 2, 3, 4]))
    second["attributes"]["COLOR_0"] = first["attributes"]["COLOR_0"]
    scene.json["materials"] = [{"name": "clay"}, {}]
    first["material"], second["material"] = 1, 0
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.uvs is not None
    assert mesh.corner_uvs is not None
    np.testing.assert_allclose(mesh.uvs[:3], [[0, 1], [1, 1], [1, 0.8]])
    assert mesh.corner_uvs.tolist() == [0, 1, 2, -1, -1, -1]
    assert set(mesh.attributes) == {"_OBSCURANCE", "color", "alpha"}
    assert mesh.attributes["color"].tolist() == [[1, 0.5, 0]] * 8
    assert mesh.attributes["alpha"].tolist() == [0.25] * 8
    np.testing.assert_array_equal(
        mesh.attributes["_OBSCURANCE"], np.array([0.1, 0.2, 0.3, 0.4, 1, 2, 3, 4], "f4")
    )
    assert counted(mesh) == {"attribute _ONCE that some primitives lack or have otherwise, left out": 1}
    assert mesh.material_names == ("material 1", "clay")
    assert mesh.polygon_materials is not None
    assert mesh.polygon_materials.tolist() == [0, 1]


def test_interleaved_tables(tmp_path: Path, Scene: Any) -> None:
    scene = Scene()
    together = scene.table(np.hstack([CORNERS, [[0, 0, 1]] * 4]).reshape(-1))
    view = scene.json["bufferViews"][together]
    view["byteStride"] = 24
    for offset in (0, 12):
        scene.json["accessors"].append(
            {"bufferView": together, "componentType": 5126, "count": 4, "type": "VEC3", "byteOffset": offset}
        )
    made = {"attributes": {"POSITION": 1, "NORMAL": 2}, "indices": scene.table([0, 1, 2], "u4")}
    scene.json["meshes"][0]["primitives"].append(made)
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.normals is not None
    assert mesh.vertices.tolist() == CORNERS.tolist()
    assert mesh.normals.tolist() == [[0, 0, 1]] * 4


Change = Callable[[dict[str, Any]], Any]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda j: j["asset"].update(version="1.0"), "version '1.0'; export it as glTF 2"),
        (lambda j: j.pop("asset"), "has no 'asset'"),
        (lambda j: j["accessors"][0].update(sparse={}), "sparse has no indices and values"),
        (lambda j: j["accessors"][0].update(count=5), "reaches beyond its buffer view"),
        (lambda j: j["accessors"][0].update(count=4_000_000_000), "reaches beyond its buffer"),
        (lambda j: j["accessors"][0].update(count=-1), "count must be a whole number"),
        (lambda j: j["accessors"][0].update(count=True), "count must be a whole number"),
        (lambda j: j["accessors"][0].update(type="MAT4"), "not fit for its use"),
        (lambda j: j["accessors"][0].update(type=["VEC3"]), "not fit for its use"),
        (lambda j: j["accessors"][1].update(componentType=5126), "no whole numbers|beyond"),
        (lambda j: j["bufferViews"][0].update(byteStride=8), "reaches beyond"),
        (lambda j: j["bufferViews"][0].update(byteLength=9_000_000_000), "ends at byte 9000000000 of"),
        (lambda j: j["bufferViews"][0].update(buffer=1), r"refers to buffers\[1\]"),
        (lambda j: j["meshes"][0].update(primitives=[]), "has no faces"),
        (lambda j: j["meshes"][0].update(primitives=[3]), "no list of primitives"),
        (lambda j: j["meshes"][0]["primitives"][0].update(mode=7), "unknown mode"),
        (lambda j: j["meshes"][0]["primitives"][0].update(attributes={}), "without POSITION"),
        (lambda j: j["nodes"][0].update(mesh="0"), r"refers to meshes\['0'\]"),
        (lambda j: j["nodes"][0].update(children=[0]), r"nodes\[0\] is among its own descendants"),
        (lambda j: j["nodes"][0].update(children=5), "children is no list"),
        (lambda j: j["nodes"][0].update(matrix=[1, 2]), "must be 16 finite numbers"),
        (lambda j: j["nodes"][0].update(scale=[1, 1e999, 1]), "must be 3 finite numbers"),
        (lambda j: j["nodes"][0].update(scale=[1e18, 1, 1], translation=[1e18, 0, 0]), "2 of 4 vertices"),
        (lambda j: j.update(nodes={}), "its nodes are no list"),
        (lambda j: j["scenes"][0].update(nodes=[]), "has no faces"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, change: Change, message: str, square: Any) -> None:
    scene = square()
    change(scene.json)
    with pytest.raises(InputError, match=message) as caught:
        read_mesh(scene.write(tmp_path / "a.glb"))
    assert "; " in str(caught.value)


def test_a_mesh_of_indices_out_of_range_alone_is_refused(tmp_path: Path, Scene: Any) -> None:
    scene = Scene()
    scene.primitive([0, 1, 4])
    with pytest.raises(
        InputError, match=r"has no faces \(triangles of vertices that are not there, left out\)"
    ):
        read_mesh(scene.write(tmp_path / "a.glb"))


def test_positions_that_are_not_finite_are_refused(tmp_path: Path, Scene: Any) -> None:
    scene = Scene()
    made = scene.primitive([0, 1, 2])
    made["attributes"]["POSITION"] = scene.table([[0, 0, 0], [1, np.nan, 0], [0, 1, 0]])
    with pytest.raises(InputError, match=r"1 of 3 vertices .* the first is number 2"):
        read_mesh(scene.write(tmp_path / "a.glb"))


def test_damaged_containers_are_refused(tmp_path: Path, square: Any) -> None:
    path = square().write(tmp_path / "a.glb")
    whole = path.read_bytes()
    for content, message in [
        (whole[:-4], r"the file is cut off, bufferViews\[1\] ends at byte 60 of its buffer, which has 56"),
        (whole[:100], r"a.glb:1: is no JSON"),
        (whole[:4] + b"\1" + whole[5:], "of version 1"),
        (whole[:12] + b"\xff" + whole[13:], "chunk reaches beyond|is no JSON|no JSON chunk"),
        (whole.replace(b"JSON", b"JSOM"), "no JSON chunk"),
        (whole.replace(b"BIN\0", b"BUN\0"), "no binary chunk"),
        (b"{", "a.glb:1: is no JSON"),
        (b"[" * 100_000, "is no JSON"),
        (b'{"asset": {"version": "2.0"}, "scene": ' + b"9" * 5000 + b"}", "is no JSON"),
    ]:
        path.write_bytes(content)
        with pytest.raises(InputError, match=message):
            read_mesh(path)


def test_meshes_placed_too_often_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, square: Any
) -> None:
    monkeypatch.setattr(primitives, "MOST_CORNERS", 100)
    scene = square()
    scene.json["nodes"] = [{"mesh": 0} for _ in range(20)]
    scene.json["scenes"][0]["nodes"] = list(range(20))
    with pytest.raises(LimitError, match="more than 100"):
        read_mesh(scene.write(tmp_path / "a.glb"))


def test_a_drawing_of_points_is_counted_and_the_rest_read(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.primitive([0, 1, 2])
    scene.primitive([0, 1], mode=1)
    scene.json["nodes"] = [{"mesh": 0}, {"mesh": 0}, {"name": "empty"}]
    scene.json["scenes"][0]["nodes"] = [2, 0, 1]
    path = scene.write(tmp_path / "a.glb")
    mesh = read_mesh(path)
    assert mesh.polygon_count == 6
    assert counted(mesh) == {"primitives of points or lines left out": 2}
    assert mesh.repairs["primitives of points or lines left out"].first == ": meshes[0].primitives[2]"


def test_colours_with_and_without_alpha(tmp_path: Path, Scene: Any) -> None:
    for width in (3, 4):
        scene = Scene()
        scene.primitive([0, 1, 2], COLOR_0=scene.table(np.full((4, width), 0.5)))
        attributes = read_mesh(scene.write(tmp_path / "a.glb")).attributes
        assert attributes["color"].tolist() == [[0.5] * 3] * 4
        assert ("alpha" in attributes) == (width == 4)


def test_joints_of_strips_are_counted(tmp_path: Path, Scene: Any) -> None:
    scene = Scene()
    scene.primitive([0, 1, 2, 2, 3, 3, 0, 2], mode=5)
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.repairs["triangles that only join strips"].count == 4
    assert triangles(mesh) == [[0, 1, 2], [0, 3, 2]]


def test_a_primitive_of_no_vertices_has_no_triangles(tmp_path: Path, square: Any) -> None:
    scene = square()
    empty = scene.primitive()
    empty["attributes"]["POSITION"] = scene.table(np.empty((0, 3)))
    assert read_mesh(scene.write(tmp_path / "a.glb")).polygon_count == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda j: j["meshes"].__setitem__(0, 7), r"meshes\[0\] is no object"),
        (lambda j: j["scenes"][0].update(nodes=0), "the scene has no list of nodes"),
    ],
)
def test_what_else_is_wrong_is_named(tmp_path: Path, change: Change, message: str, square: Any) -> None:
    scene = square()
    change(scene.json)
    with pytest.raises(InputError, match=message):
        read_mesh(scene.write(tmp_path / "a.glb"))


def test_an_address_of_a_buffer_must_be_text(tmp_path: Path, square: Any) -> None:
    path = square().write(tmp_path / "a.gltf")
    path.write_text(json.dumps({**json.loads(path.read_text()), "buffers": [{"byteLength": 9, "uri": 5}]}))
    with pytest.raises(InputError, match=r"buffers\[0\].uri is no text"):
        read_mesh(path)


def test_normals_of_a_mirrored_node_keep_their_side(tmp_path: Path, Scene: Any) -> None:
    scene = Scene()
    scene.primitive([0, 1, 2], NORMAL=scene.table([[0.6, 0, 0.8]] * 4))
    scene.json["nodes"][0]["scale"] = [-1, 1, 1]
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals[0] / np.linalg.norm(mesh.normals[0]), [-0.6, 0, 0.8], atol=1e-6)
    assert triangles(mesh) == [[2, 1, 0]]
