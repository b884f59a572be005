"""Values added to glTF documents: nothing else changes, and Khronos' validator has nothing to say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gltf_validator import faults
from illumcli.errors import InputError, LimitError
from illumcli.geometry.mesh import Mesh
from illumcli.images.encoded import png_bytes
from illumcli.mesh_files import read_mesh
from illumcli.mesh_files.color_change import COLOR_CHANGES
from illumcli.mesh_files.gltf import glb_writer
from illumcli.mesh_files.gltf.accessors import stored, table
from illumcli.mesh_files.gltf.document import Document, open_document
from illumcli.mesh_files.gltf.extend import copyable, extend_glb
from illumcli.mesh_files.occlusion import OcclusionMap, OcclusionMaps
from illumcli.mesh_files.output_mesh import VertexData

PNG = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010806000000"
    "1f15c4890000000d49444154789c6360f8cf500f0003030101b4a6c8e20000000049454e44ae426082"
)
QUAD = [0, 1, 2, 0, 2, 3]


def values_of(mesh: Mesh, at_corners: bool = False, **more: Any) -> VertexData:
    """A different value for each vertex, or for each corner as well."""
    w = np.linspace(0, 1, len(mesh.vertices), dtype=np.float32)
    of_corners = {"obscurance": np.linspace(0, 1, len(mesh.corners), dtype=np.float32)} if at_corners else {}
    return VertexData(
        {"obscurance": w, "standard_error": w / 10}, {"content": "c"}, corner_columns=of_corners, **more
    )


def extended(source: Path, at_corners: bool = False, **more: Any) -> tuple[Document, Mesh, list[str]]:
    """The document written, the mesh in it, and what it lacks."""
    out = source.with_name("out.glb")
    left_out = extend_glb(out, source, values_of(read_mesh(source), at_corners, **more))
    return open_document(out), read_mesh(out), left_out


def assert_nothing_lost(before: dict[str, Any], after: dict[str, Any]) -> None:
    """Lists keep their entries, in their order and number; attributes may be added, and extras."""
    for key, value in before.items():
        if key in ("buffers", "bufferViews", "accessors"):
            continue
        if isinstance(value, dict):
            assert_nothing_lost(value, after[key])
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for one, other in zip(value, after[key], strict=False):
                assert_nothing_lost(one, other)
            assert len(after[key]) >= len(value)
        else:
            assert after[key] == value, key


def assert_same_accessors(before: Document, after: Document) -> None:
    """Every accessor of the input has the same values in the output."""
    for number in range(len(before.items("accessors"))):
        np.testing.assert_array_equal(
            stored(before, number, (1, 2, 3, 4, 16)), stored(after, number, (1, 2, 3, 4, 16))
        )


def whole(scene: Any) -> Any:
    """A skinned and morphed square with two uv sets, tangents, colours, a camera and an animation."""
    target = {"POSITION": scene.table([[0, 0, 0]] * 3 + [[0, 0, 1]], min=[0, 0, 0], max=[0, 0, 1])}
    attributes = {
        "NORMAL": scene.table([[0, 0, 1]] * 4),
        "TANGENT": scene.table([[1, 0, 0, 1]] * 4),
        "TEXCOORD_0": scene.table([[0, 1], [1, 1], [1, 0], [0, 0]]),
        "TEXCOORD_1": scene.table([[0, 65535], [65535, 65535], [65535, 0], [0, 0]], "u2", normalized=True),
        "COLOR_0": scene.table([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]]),
        "JOINTS_0": scene.table([[0, 1, 0, 0]] * 4, "u1"),
        "WEIGHTS_0": scene.table([[0.5, 0.5, 0, 0]] * 4),
        "_MINE": scene.table([1, 2, 3, 4]),
    }
    scene.primitive(QUAD, **attributes) | {"targets": [target]}
    scene.json["meshes"][0]["primitives"][0] |= {"targets": [target], "material": 0}
    scene.json["meshes"][0]["weights"] = [0.5]
    bind = np.tile(np.eye(4).ravel(), (2, 1))
    scene.json["skins"] = [{"joints": [1, 2], "inverseBindMatrices": scene.table(bind)}]
    scene.json["nodes"] = [
        {"mesh": 0, "skin": 0, "name": "square"},
        {"children": [2], "name": "hip"},
        {"translation": [0, 1, 0], "name": "knee"},
        {"camera": 0, "extras": {"lens": "old"}},
    ]
    scene.json["scenes"] = [{"nodes": [0, 1, 3]}]
    scene.json["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}]
    times = scene.table([0, 1], min=[0], max=[1])
    moves = scene.table([[0, 1, 0], [0, 2, 0]])
    scene.json["animations"] = [
        {
            "channels": [{"sampler": 0, "target": {"node": 2, "path": "translation"}}],
            "samplers": [{"input": times, "output": moves}],
        }
    ]
    scene.json["bufferViews"].append({"buffer": 0, "byteOffset": len(scene.data), "byteLength": len(PNG)})
    scene.data += PNG + b"\0" * (-len(PNG) % 4)
    scene.json["images"] = [{"bufferView": len(scene.json["bufferViews"]) - 1, "mimeType": "image/png"}]
    scene.json["textures"] = [{"source": 0}]
    texture = {"index": 0, "texCoord": 1}
    scene.json["materials"] = [{"name": "clay", "pbrMetallicRoughness": {"baseColorTexture": texture}}]
    scene.json["extras"] = {"licence": "none"}
    return valid(scene)


def valid(scene: Any) -> Any:
    """The scene with the bounds that positions must have."""
    for mesh in scene.json["meshes"]:
        for primitive in mesh["primitives"]:
            entry = scene.json["accessors"][primitive["attributes"]["POSITION"]]
            entry |= {"min": [0, 0, 0], "max": [1, 1, 0]}
    return scene


def test_a_whole_asset_keeps_everything(tmp_path: Path, Scene: Any) -> None:
    source = whole(Scene()).write(tmp_path / "a.glb")
    document, mesh, left_out = extended(source)
    assert left_out == []
    assert_nothing_lost(open_document(source).json, document.json)
    assert_same_accessors(open_document(source), document)
    attributes = document.json["meshes"][0]["primitives"][0]["attributes"]
    np.testing.assert_allclose(table(document, attributes["_OBSCURANCE"], (1,))[:, 0], np.linspace(0, 1, 4))
    assert document.json["asset"]["extras"]["illum"]["content"] == "c"
    np.testing.assert_array_equal(mesh.vertices, read_mesh(source).vertices)
    assert faults(source) == faults(tmp_path / "out.glb") == []


def test_split_vertices_keep_everything(tmp_path: Path, Scene: Any) -> None:
    source = whole(Scene()).write(tmp_path / "a.glb")
    document, mesh, left_out = extended(source, at_corners=True)
    assert left_out == []
    before = read_mesh(source)
    np.testing.assert_array_equal(mesh.vertices[mesh.corners], before.vertices[before.corners])
    np.testing.assert_array_equal(mesh.uvs[mesh.corner_uvs], before.uvs[before.corner_uvs])
    np.testing.assert_allclose(mesh.attributes["_OBSCURANCE"][mesh.corners], np.linspace(0, 1, 6))
    assert len(document.json["accessors"]) == len(open_document(source).json["accessors"]) + 2
    primitive = document.json["meshes"][0]["primitives"][0]
    old = open_document(source)
    corners = stored(document, primitive["indices"], (1,))[:, 0]
    for name, number in old.json["meshes"][0]["primitives"][0]["attributes"].items():
        new = stored(document, primitive["attributes"][name], (1, 2, 3, 4))
        np.testing.assert_array_equal(new[corners], stored(old, number, (1, 2, 3, 4))[QUAD])
    assert stored(document, primitive["targets"][0]["POSITION"], (3,))[corners].tolist() == [
        [0, 0, 0],
        [0, 0, 0],
        [0, 0, 0],
        [0, 0, 0],
        [0, 0, 0],
        [0, 0, 1],
    ]
    assert faults(tmp_path / "out.glb") == []


def test_baking_again_replaces_the_values(tmp_path: Path, Scene: Any) -> None:
    source = whole(Scene()).write(tmp_path / "a.glb")
    extended(source)
    size = (tmp_path / "out.glb").stat().st_size
    again = (tmp_path / "out.glb").rename(tmp_path / "again.glb")
    mesh = read_mesh(again)
    data = values_of(mesh)
    data = VertexData({name: each[::-1] for name, each in data.columns.items()}, data.about)
    assert extend_glb(tmp_path / "out.glb", again, data) == []
    np.testing.assert_allclose(
        read_mesh(tmp_path / "out.glb").attributes["_OBSCURANCE"], np.linspace(1, 0, 4)
    )
    assert abs((tmp_path / "out.glb").stat().st_size - size) < 64
    assert_same_accessors(open_document(source), open_document(tmp_path / "out.glb"))
    assert faults(tmp_path / "out.glb") == []


def test_files_beside_the_document_are_pulled_in(tmp_path: Path, Scene: Any) -> None:
    scene = whole(Scene())
    del scene.json["images"][0]["bufferView"]
    del scene.json["images"][0]["mimeType"]
    scene.json["images"][0]["uri"] = "red%20brick.png"
    scene.json["images"].append({"uri": "red%20brick.png"})
    scene.json["images"].append({"uri": "lost.png"})
    (tmp_path / "red brick.png").write_bytes(PNG)
    (tmp_path / "a.bin").write_bytes(scene.data)
    source = scene.write(tmp_path / "a.gltf", uri="a.bin")
    document, _, left_out = extended(source)
    assert left_out == ["images[2], lost.png, which cannot be read"]
    assert len(document.json["buffers"]) == 1
    assert "uri" not in document.json["buffers"][0]
    data, start, end = document.view(document.json["images"][0]["bufferView"])
    assert data[start:end] == PNG
    assert document.json["images"][0] == document.json["images"][1]
    assert document.json["images"][0]["mimeType"] == "image/png"
    assert_same_accessors(open_document(source), document)


def test_a_mesh_at_two_nodes_is_copied_where_values_differ(tmp_path: Path, square: Any) -> None:
    scene = valid(square())
    scene.json["nodes"] = [{"mesh": 0, "name": "left"}, {"mesh": 0, "translation": [3, 0, 0]}]
    scene.json["scenes"] = [{"nodes": [0, 1]}]
    source = scene.write(tmp_path / "a.glb")
    document, mesh, _ = extended(source)
    np.testing.assert_allclose(mesh.attributes["_OBSCURANCE"], np.linspace(0, 1, 8))
    one, two = (document.json["meshes"][k]["primitives"][0] for k in (0, 1))
    assert [node["mesh"] for node in document.json["nodes"]] == [0, 1]
    assert one["attributes"]["POSITION"] == two["attributes"]["POSITION"]
    assert one["indices"] == two["indices"]
    assert faults(tmp_path / "out.glb") == []

    # equal values: one mesh
    data = VertexData({"obscurance": np.tile(np.float32([0, 1, 2, 3]) / 3, 2)}, {})
    extend_glb(tmp_path / "same.glb", source, data)
    assert len(open_document(tmp_path / "same.glb").json["meshes"]) == 1


def test_a_node_of_another_scene_keeps_its_mesh(tmp_path: Path, square: Any) -> None:
    scene = valid(square())
    scene.json["nodes"] = [{"mesh": 0}, {"mesh": 0}]
    scene.json["scenes"] = [{"nodes": [0]}, {"nodes": [1]}]
    document, _, _ = extended(scene.write(tmp_path / "a.glb"))
    assert [node["mesh"] for node in document.json["nodes"]] == [1, 0]
    assert "_OBSCURANCE" not in document.json["meshes"][0]["primitives"][0]["attributes"]
    assert faults(tmp_path / "out.glb") == []


def test_instances_with_values_of_their_own_become_nodes(tmp_path: Path, square: Any) -> None:
    scene = valid(square())
    attributes = {
        "TRANSLATION": scene.table([[0, 0, 0], [5, 0, 0]]),
        "SCALE": scene.table([[1, 1, 1], [-1, 1, 1]]),
        "_ID": scene.table([7, 8]),
    }
    scene.json["nodes"][0] |= {"extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}}
    scene.json["extensionsUsed"] = ["EXT_mesh_gpu_instancing"]
    source = scene.write(tmp_path / "a.glb")
    document, mesh, left_out = extended(source, at_corners=True)
    before = read_mesh(source)
    np.testing.assert_array_equal(mesh.vertices[mesh.corners], before.vertices[before.corners])
    np.testing.assert_allclose(mesh.attributes["_OBSCURANCE"][mesh.corners], np.linspace(0, 1, 12))
    assert left_out == []
    assert "extensionsUsed" not in document.json
    assert [document.json["nodes"][k]["extras"] for k in document.json["nodes"][0]["children"]] == [
        {"_ID": [7]},
        {"_ID": [8]},
    ]
    assert faults(tmp_path / "out.glb") == []


@pytest.mark.parametrize(("mode", "corners"), [(4, None), (5, [0, 1, 3, 2]), (6, None)])
@pytest.mark.parametrize("at_corners", [False, True])
def test_primitives_of_any_mode_and_drawings_keep_their_form(
    tmp_path: Path, Scene: Any, mode: int, corners: Any, at_corners: bool
) -> None:
    scene = Scene()
    scene.primitive(corners, mode=mode)
    scene.primitive([0, 1, 2, 3], mode=0)
    scene.primitive([0, 2], mode=1)
    if mode == 4:
        for primitive in scene.json["meshes"][0]["primitives"][:1]:
            primitive["indices"] = scene.table(QUAD, "u1")
    source = valid(scene).write(tmp_path / "a.glb")
    document, mesh, _ = extended(source, at_corners)
    before = read_mesh(source)
    np.testing.assert_array_equal(mesh.vertices[mesh.corners], before.vertices[before.corners])
    old, new = (each.json["meshes"][0]["primitives"] for each in (open_document(source), document))
    assert new[1:] == old[1:]
    assert at_corners or new[0].get("mode") == mode
    assert faults(tmp_path / "out.glb") == []


def test_sparse_tables_are_kept(tmp_path: Path, Scene: Any) -> None:
    scene = Scene()
    scene.primitive(QUAD)
    position = scene.json["accessors"][0]
    moved, rows = scene.table([2], "u2"), scene.table([[1, 1, 0]])
    views = [scene.json["accessors"][k]["bufferView"] for k in (moved, rows)]
    position["sparse"] = {
        "count": 1,
        "indices": {"bufferView": views[0], "componentType": 5123},
        "values": {"bufferView": views[1]},
    }
    del scene.json["accessors"][2:]
    source = valid(scene).write(tmp_path / "a.glb")
    for at_corners in (False, True):
        document, mesh, _ = extended(source, at_corners)
        before = read_mesh(source)
        np.testing.assert_array_equal(mesh.vertices[mesh.corners], before.vertices[before.corners])
        assert at_corners or document.json["accessors"][0]["sparse"] == position["sparse"]
        assert faults(tmp_path / "out.glb") == []


def test_colour_channels_are_replaced_and_the_others_kept(tmp_path: Path, Scene: Any) -> None:
    source = whole(Scene()).write(tmp_path / "a.glb")
    _, mesh, _ = extended(source, color=COLOR_CHANGES["g"])
    np.testing.assert_allclose(mesh.attributes["color"][:, 1], [0, 1 / 3, 2 / 3, 1], rtol=1e-6)
    assert mesh.attributes["color"][:, 0].tolist() == [1, 0, 0, 1]
    assert mesh.attributes["color"][:, 2].tolist() == [0, 0, 1, 1]
    assert faults(tmp_path / "out.glb") == []


def test_a_compressed_form_is_left_out_and_told(tmp_path: Path, square: Any) -> None:
    scene = valid(square())
    draco = {"bufferView": 0, "attributes": {"POSITION": 0}}
    scene.json["meshes"][0]["primitives"][0]["extensions"] = {"KHR_draco_mesh_compression": draco, "MINE": {}}
    scene.json["extensionsUsed"] = ["KHR_draco_mesh_compression", "MINE"]
    document, _, left_out = extended(scene.write(tmp_path / "a.glb"))
    assert left_out == ["the compressed form of primitives (KHR_draco_mesh_compression)"]
    assert document.json["extensionsUsed"] == ["MINE"]
    assert document.json["meshes"][0]["primitives"][0]["extensions"] == {"MINE": {}}


def test_the_document_read_is_not_changed(tmp_path: Path, Scene: Any) -> None:
    source = whole(Scene()).write(tmp_path / "a.glb")
    before = source.read_bytes()
    extended(source)
    assert source.read_bytes() == before


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("nodes", 0, "mesh"), 7),
        (("accessors", 3, "bufferView"), "x"),
        (("bufferViews", 1, "byteOffset"), -1),
        (("images", 0), None),
        (("textures", 0, "source"), 9),
        (("meshes", 0, "primitives", 0, "attributes", "_MINE"), 99),
        (("meshes", 0, "primitives", 0, "targets", 0), []),
        (("meshes", 0, "primitives", 0, "material"), -1),
        (("materials", 0, "occlusionTexture"), 1),
        (("nodes", 1, "children"), {}),
    ],
)
def test_a_malformed_part_is_refused_by_name(tmp_path: Path, Scene: Any, path: Any, value: Any) -> None:
    scene = whole(Scene())
    part = scene.json
    for key in path[:-1]:
        part = part[key]
    part[path[-1]] = value
    source = scene.write(tmp_path / "a.glb")
    with pytest.raises(InputError, match=rf"a\.glb: {path[0]}.*malformed.*bake to \.npz"):
        copyable(source)


def test_a_file_beyond_the_limit_of_the_format_is_refused(
    tmp_path: Path, Scene: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = whole(Scene()).write(tmp_path / "a.glb")
    monkeypatch.setattr(glb_writer, "LARGEST", 1000)
    with pytest.raises(LimitError, match=r"out\.glb: would be larger than 4 GiB"):
        extended(source)


# ------------------------------------------------------------------ occlusion textures


def with_texture(source: Path, out: str = "out.glb", **more: Any) -> tuple[dict[str, Any], list[str]]:
    """The JSON of a file with an occlusion texture for its first material, and what it lacks."""
    png = png_bytes(np.full((4, 4, 1), more.pop("level", 128), np.uint8), srgb=False)
    maps = OcclusionMaps({(0, 0): OcclusionMap("occlusion", png)}, **more)
    left_out = extend_glb(source.with_name(out), source, values_of(read_mesh(source)), maps)
    return open_document(source.with_name(out)).json, left_out


def test_a_texture_becomes_that_of_its_material(tmp_path: Path, Scene: Any) -> None:
    source = whole(Scene()).write(tmp_path / "a.glb")
    json, left_out = with_texture(source)
    assert left_out == []
    assert json["materials"][0]["occlusionTexture"] == {"index": 1}
    assert json["textures"] == [{"source": 0}, {"source": 1}]
    assert json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] == {"index": 0, "texCoord": 1}
    assert faults(tmp_path / "out.glb") == []


def test_the_occlusion_of_a_packed_texture_is_replaced_and_the_rest_kept(tmp_path: Path, Scene: Any) -> None:
    scene = whole(Scene())
    material = scene.json["materials"][0]
    material["occlusionTexture"] = {"index": 0, "strength": 0.5}
    material["pbrMetallicRoughness"]["metallicRoughnessTexture"] = {"index": 0}
    json, left_out = with_texture(scene.write(tmp_path / "a.glb"))
    assert left_out == ["the former occlusion texture of material clay"]
    assert json["materials"][0]["occlusionTexture"] == {"index": 1}
    assert json["materials"][0]["pbrMetallicRoughness"]["metallicRoughnessTexture"] == {"index": 0}
    assert faults(tmp_path / "out.glb") == []

    # again: its own texture is replaced, and no image is added
    again, _ = with_texture(tmp_path / "out.glb", "again.glb", level=7)
    assert len(again["images"]) == len(again["textures"]) == 2
    document = open_document(tmp_path / "again.glb")
    data, start, end = document.view(again["images"][1]["bufferView"])
    assert data[start:end] == png_bytes(np.full((4, 4, 1), 7, np.uint8), srgb=False)
    assert (tmp_path / "again.glb").stat().st_size < (tmp_path / "out.glb").stat().st_size + 64
    assert faults(tmp_path / "again.glb") == []


def test_a_material_of_other_primitives_is_copied(tmp_path: Path, Scene: Any) -> None:
    scene = whole(Scene())
    scene.json["meshes"].append({"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]})
    scene.json["nodes"].append({"mesh": 1})
    json, _ = with_texture(scene.write(tmp_path / "a.glb"))
    assert [mesh["primitives"][0]["material"] for mesh in json["meshes"]] == [1, 0]
    assert "occlusionTexture" not in json["materials"][0]
    assert json["materials"][1]["name"] == "clay"


def test_primitives_without_uv_keep_a_material_without_the_texture(tmp_path: Path, Scene: Any) -> None:
    scene = whole(Scene())
    with_uv = scene.json["meshes"][0]["primitives"][0]
    bare = {**with_uv, "attributes": {"POSITION": with_uv["attributes"]["POSITION"]}}
    scene.json["materials"].append({"name": "plain"})
    scene.json["meshes"][0]["primitives"].append({**bare, "material": 1})
    with_uv["material"] = 1
    source = scene.write(tmp_path / "a.glb")
    png = png_bytes(np.zeros((4, 4, 1), np.uint8), srgb=False)
    mesh = read_mesh(source)
    maps = OcclusionMaps({(0, mesh.material_names.index("plain")): OcclusionMap("occlusion", png)})
    extend_glb(tmp_path / "out.glb", source, values_of(mesh), maps)
    json = open_document(tmp_path / "out.glb").json
    first, second = (each["material"] for each in json["meshes"][0]["primitives"])
    assert "occlusionTexture" in json["materials"][first]
    assert "occlusionTexture" not in json["materials"][second]
    assert faults(tmp_path / "out.glb") == []


def test_uv_of_textures_become_a_further_set(tmp_path: Path, Scene: Any) -> None:
    source = whole(Scene()).write(tmp_path / "a.glb")
    uv = np.array([[0, 0], [1, 0], [1, 1], [0.25, 0], [1, 1], [0, 1]])
    json, _ = with_texture(source, uvs={0: uv})
    assert json["materials"][0]["occlusionTexture"] == {"index": 1, "texCoord": 2}
    primitive = json["meshes"][0]["primitives"][0]
    document = open_document(tmp_path / "out.glb")
    corners = stored(document, primitive["indices"], (1,))[:, 0]
    made = stored(document, primitive["attributes"]["TEXCOORD_2"], (2,))[corners]
    np.testing.assert_allclose(made, uv * [1, -1] + [0, 1])
    first = stored(document, primitive["attributes"]["TEXCOORD_0"], (2,))[corners]
    np.testing.assert_array_equal(first, np.array([[0, 1], [1, 1], [1, 0], [0, 0]])[QUAD])
    assert faults(tmp_path / "out.glb") == []


def test_polygons_without_a_material_get_one(tmp_path: Path, square: Any) -> None:
    scene = valid(square())
    scene.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = scene.table(np.zeros((4, 2)))
    source = scene.write(tmp_path / "a.glb")
    png = png_bytes(np.zeros((4, 4, 1), np.uint8), srgb=False)
    maps = OcclusionMaps({(0, -1): OcclusionMap("occlusion", png)})
    extend_glb(tmp_path / "out.glb", source, values_of(read_mesh(source)), maps)
    json = open_document(tmp_path / "out.glb").json
    assert json["materials"] == [{"occlusionTexture": {"index": 0}}]
    assert json["meshes"][0]["primitives"][0]["material"] == 0
    assert faults(tmp_path / "out.glb") == []
