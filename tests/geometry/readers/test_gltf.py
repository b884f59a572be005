from __future__ import annotations

import base64
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from illumcli.errors import InputError, LimitError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.readers import gltf, read_mesh
from illumcli.geometry.repairs import HARMLESS

KINDS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "f4")


class Scene:
    """A glTF document under construction: one buffer, one view per table."""

    def __init__(self) -> None:
        self.data = b""
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": []}],
            "accessors": [],
            "bufferViews": [],
        }

    def table(self, values: Any, kind: str = "f4", **more: Any) -> int:
        array = np.array(values, kind)
        self.json["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": array.nbytes}
        )
        self.data += array.tobytes() + b"\0" * (-array.nbytes % 4)
        width = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[1 if array.ndim == 1 else array.shape[1]]
        view = len(self.json["bufferViews"]) - 1
        entry = {"bufferView": view, "componentType": KINDS[kind], "count": len(array), "type": width, **more}
        self.json["accessors"].append(entry)
        return len(self.json["accessors"]) - 1

    def primitive(
        self, indices: Any = None, mode: int | None = None, mesh: int = 0, **attributes: int
    ) -> dict:
        made: dict[str, Any] = {"attributes": {"POSITION": self.table(CORNERS), **attributes}}
        if indices is not None:
            made["indices"] = self.table(indices, "u2")
        if mode is not None:
            made["mode"] = mode
        self.json["meshes"][mesh]["primitives"].append(made)
        return made

    def write(self, path: Path, uri: str | None = None) -> Path:
        self.json["buffers"] = [{"byteLength": len(self.data)}]
        if path.suffix == ".gltf":
            inline = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
            self.json["buffers"][0]["uri"] = inline if uri is None else uri
            path.write_text(json.dumps(self.json))
            return path
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        chunks = len(text).to_bytes(4, "little") + b"JSON" + text
        chunks += len(self.data).to_bytes(4, "little") + b"BIN\0" + self.data
        path.write_bytes(
            b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks
        )
        return path


def counted(mesh: Mesh) -> dict[str, int]:
    """What the mesh's repairs count, without what is harmless."""
    return {what: each.count for what, each in mesh.repairs.items() if what not in HARMLESS}


def square() -> Scene:
    scene = Scene()
    scene.primitive([0, 1, 2, 0, 2, 3])
    return scene


def triangles(mesh: Mesh) -> list[list[int]]:
    return mesh.corners.reshape(-1, 3).tolist()


@pytest.mark.parametrize("suffix", [".gltf", ".glb"])
def test_triangles_of_both_kinds_of_file(tmp_path: Path, suffix: str) -> None:
    mesh = read_mesh(square().write(tmp_path / f"a{suffix}"))
    assert mesh.vertices.tolist() == CORNERS.tolist()
    assert triangles(mesh) == [[0, 1, 2], [0, 2, 3]]
    assert mesh.normals is None
    assert mesh.uvs is None
    assert mesh.material_names == ()
    assert counted(mesh) == {}


def test_buffers_may_be_files_beside(tmp_path: Path) -> None:
    scene = square()
    (tmp_path / "my data.bin").write_bytes(scene.data)
    assert read_mesh(scene.write(tmp_path / "a.gltf", uri="my%20data.bin")).polygon_count == 2


@pytest.mark.parametrize("uri", ["../x.bin", "/etc/passwd", "link.bin", "%2e%2e/x.bin"])
def test_buffers_outside_the_folder_are_refused(tmp_path: Path, uri: str) -> None:
    folder = tmp_path / "meshes"
    folder.mkdir()
    scene = square()
    (tmp_path / "x.bin").write_bytes(scene.data)
    (folder / "link.bin").symlink_to(tmp_path / "x.bin")
    with pytest.raises(InputError, match=r"leads out of the folder|absolute path"):
        read_mesh(scene.write(folder / "a.gltf", uri=uri))


def test_buffers_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo.bin")
    for uri, message in [
        ("fifo.bin", "no regular file"),
        ("absent.bin", "no such file"),
        ("http://example.org/a.bin", "on the network"),
        ("data:application/octet-stream;base64,????", "no readable data URI"),
        ("data:application/octet-stream;base64,AAA\u07f6", "no readable data URI"),
        ("data:,\ud800", "no readable data URI"),
        ("\ud800.bin", "no usable path|cannot be read"),
        ("data:application/octet-stream;base64,AAAA", "announces .* bytes and has 3"),
    ]:
        with pytest.raises(InputError, match=message):
            read_mesh(square().write(tmp_path / "a.gltf", uri=uri))


def test_strips_fans_and_loose_corners(tmp_path: Path) -> None:
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


def test_nodes_place_their_meshes(tmp_path: Path) -> None:
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


def test_without_scenes_every_node_without_a_parent_is_a_root(tmp_path: Path) -> None:
    scene = square()
    del scene.json["scenes"], scene.json["scene"]
    scene.json["nodes"] = [{"mesh": 0}, {"children": [0], "translation": [0, 0, 7]}]
    assert read_mesh(scene.write(tmp_path / "a.glb")).vertices[0].tolist() == [0, 0, 7]


def test_attributes_of_vertices(tmp_path: Path) -> None:
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
    assert counted(mesh) == {"attributes that some primitives lack, left out": 1}
    assert mesh.material_names == ("material 1", "clay")
    assert mesh.polygon_materials is not None
    assert mesh.polygon_materials.tolist() == [0, 1]


def test_interleaved_tables(tmp_path: Path) -> None:
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
        (
            lambda j: j.update(extensionsRequired=["KHR_draco_mesh_compression"]),
            "'KHR_draco_mesh_compression', which",
        ),
        (lambda j: j.update(extensionsRequired=7), "extension 7"),
        (lambda j: j["accessors"][0].pop("bufferView"), "compressed meshes are not read"),
        (lambda j: j["accessors"][0].update(sparse={}), "sparse"),
        (lambda j: j["accessors"][0].update(count=5), "reaches beyond its buffer"),
        (lambda j: j["accessors"][0].update(count=4_000_000_000), "reaches beyond its buffer"),
        (lambda j: j["accessors"][0].update(count=-1), "count must be a whole number"),
        (lambda j: j["accessors"][0].update(count=True), "count must be a whole number"),
        (lambda j: j["accessors"][0].update(type="MAT4"), "not fit for its use"),
        (lambda j: j["accessors"][0].update(type=["VEC3"]), "not fit for its use"),
        (lambda j: j["accessors"][1].update(componentType=5126), "no whole numbers|beyond"),
        (lambda j: j["accessors"][1].update(count=5), "has 5 corners"),
        (lambda j: j["bufferViews"][0].update(byteStride=0), "reaches beyond"),
        (lambda j: j["bufferViews"][0].update(byteLength=9_000_000_000), "reaches beyond"),
        (lambda j: j["bufferViews"][0].update(buffer=1), r"refers to buffers\[1\]"),
        (lambda j: j["meshes"][0].update(primitives=[]), "has no faces"),
        (lambda j: j["meshes"][0].update(primitives=[3]), "no list of primitives"),
        (lambda j: j["meshes"][0]["primitives"][0].update(mode=7), "unknown mode"),
        (lambda j: j["meshes"][0]["primitives"][0].update(attributes={}), "no POSITION"),
        (lambda j: j["meshes"][0]["primitives"][0].update(material=0), r"refers to materials\[0\]"),
        (lambda j: j["nodes"][0].update(mesh="0"), r"refers to meshes\['0'\]"),
        (lambda j: j["nodes"][0].update(children=[0]), r"nodes\[0\] has two parents"),
        (lambda j: j["nodes"][0].update(children=5), "children is no list"),
        (lambda j: j["nodes"][0].update(matrix=[1, 2]), "must be 16 finite numbers"),
        (lambda j: j["nodes"][0].update(scale=[1, 1e999, 1]), "must be 3 finite numbers"),
        (lambda j: j["nodes"][0].update(rotation=[0, 0, 0, 0]), "rotation has no length"),
        (lambda j: j["nodes"][0].update(scale=[1e18, 1, 1], translation=[1e18, 0, 0]), "2 of 4 vertices"),
        (lambda j: j.update(scene=1), r"refers to scenes\[1\]"),
        (lambda j: j.update(nodes={}), "its nodes are no list"),
        (lambda j: j["scenes"][0].update(nodes=[]), "has no faces"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, change: Change, message: str) -> None:
    scene = square()
    change(scene.json)
    with pytest.raises(InputError, match=message) as caught:
        read_mesh(scene.write(tmp_path / "a.glb"))
    assert "; " in str(caught.value)


def test_indices_out_of_range_are_refused(tmp_path: Path) -> None:
    scene = Scene()
    scene.primitive([0, 1, 4])
    with pytest.raises(InputError, match="index 4 of a primitive is out of range, it has 4 vertices"):
        read_mesh(scene.write(tmp_path / "a.glb"))


def test_positions_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    scene = Scene()
    made = scene.primitive([0, 1, 2])
    made["attributes"]["POSITION"] = scene.table([[0, 0, 0], [1, np.nan, 0], [0, 1, 0]])
    with pytest.raises(InputError, match=r"1 of 3 vertices .* the first is number 2"):
        read_mesh(scene.write(tmp_path / "a.glb"))


def test_damaged_containers_are_refused(tmp_path: Path) -> None:
    path = square().write(tmp_path / "a.glb")
    whole = path.read_bytes()
    for content, message in [
        (whole[:-4], r"announces \d+ bytes and has \d+; the file is cut off"),
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


def test_meshes_placed_too_often_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gltf, "MOST_CORNERS", 100)
    scene = square()
    scene.json["nodes"] = [{"mesh": 0} for _ in range(20)]
    scene.json["scenes"][0]["nodes"] = list(range(20))
    with pytest.raises(LimitError, match="more than 100"):
        read_mesh(scene.write(tmp_path / "a.glb"))


def test_a_drawing_of_points_and_skins_is_counted_and_the_rest_read(tmp_path: Path) -> None:
    scene = square()
    scene.primitive([0, 1, 2])["targets"] = [{"POSITION": 0}]
    scene.primitive([0, 1], mode=1)
    scene.json["nodes"] = [{"mesh": 0, "skin": 0}, {"mesh": 0}, {"name": "empty"}]
    scene.json["scenes"][0]["nodes"] = [2, 0, 1]
    scene.json["extensionsRequired"] = ["KHR_materials_unlit"]
    path = scene.write(tmp_path / "a.glb")
    mesh = read_mesh(path)
    assert mesh.polygon_count == 6
    assert counted(mesh) == {
        "skins left out": 1,
        "morph targets left out": 2,
        "primitives of points or lines left out": 2,
    }
    assert gltf.primitives_of(path) == [(0, 0, 4), (0, 1, 4)] * 2


def test_colours_with_and_without_alpha(tmp_path: Path) -> None:
    for width in (3, 4):
        scene = Scene()
        scene.primitive([0, 1, 2], COLOR_0=scene.table(np.full((4, width), 0.5)))
        attributes = read_mesh(scene.write(tmp_path / "a.glb")).attributes
        assert attributes["color"].tolist() == [[0.5] * 3] * 4
        assert ("alpha" in attributes) == (width == 4)


def test_joints_of_strips_are_counted(tmp_path: Path) -> None:
    scene = Scene()
    scene.primitive([0, 1, 2, 2, 3, 3, 0, 2], mode=5)
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.repairs["triangles that only join strips"].count == 4
    assert triangles(mesh) == [[0, 1, 2], [0, 3, 2]]


def test_a_primitive_of_no_vertices_has_no_triangles(tmp_path: Path) -> None:
    scene = square()
    empty = scene.primitive()
    empty["attributes"]["POSITION"] = scene.table(np.empty((0, 3)))
    assert read_mesh(scene.write(tmp_path / "a.glb")).polygon_count == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda j: j["meshes"].__setitem__(0, 7), r"meshes\[0\] is no object"),
        (lambda j: j["scenes"][0].update(nodes=0), "the scene has no list of nodes"),
        (
            lambda j: j["meshes"][0]["primitives"][0]["attributes"].update(NORMAL=1),
            "NORMAL has 6 rows for 4 vertices|which is not fit",
        ),
        (
            lambda j: (
                j["meshes"][0]["primitives"][0].update(indices=2),
                j["accessors"].append({"bufferView": 0, "componentType": 5126, "count": 3, "type": "SCALAR"}),
            ),
            "are no whole numbers",
        ),
        (
            lambda j: (
                j["meshes"][0]["primitives"][0]["attributes"].update(NORMAL=2),
                j["accessors"].append({"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}),
            ),
            "NORMAL has 3 rows for 4 vertices",
        ),
    ],
)
def test_what_else_is_wrong_is_named(tmp_path: Path, change: Change, message: str) -> None:
    scene = square()
    change(scene.json)
    with pytest.raises(InputError, match=message):
        read_mesh(scene.write(tmp_path / "a.glb"))


def test_an_address_of_a_buffer_must_be_text(tmp_path: Path) -> None:
    path = square().write(tmp_path / "a.gltf")
    path.write_text(json.dumps({**json.loads(path.read_text()), "buffers": [{"byteLength": 9, "uri": 5}]}))
    with pytest.raises(InputError, match=r"buffers\[0\].uri is no text"):
        read_mesh(path)


def test_normals_of_a_mirrored_node_keep_their_side(tmp_path: Path) -> None:
    scene = Scene()
    scene.primitive([0, 1, 2], NORMAL=scene.table([[0.6, 0, 0.8]] * 4))
    scene.json["nodes"][0]["scale"] = [-1, 1, 1]
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals[0] / np.linalg.norm(mesh.normals[0]), [-0.6, 0, 0.8], atol=1e-6)
    assert triangles(mesh) == [[2, 1, 0]]
