"""New GLB files: what glTF asks of their numbers, a node per group, a primitive per material."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gltf_validator import faults
from illumcli.images.encoded import png_bytes
from illumcli.mesh_files import read_mesh
from illumcli.mesh_files.gltf.accessors import stored
from illumcli.mesh_files.gltf.document import open_document
from illumcli.mesh_files.gltf.write import unit_rows, write_glb
from illumcli.mesh_files.occlusion import OcclusionMap, OcclusionMaps
from illumcli.mesh_files.output_mesh import TEXTURE_UV, OutputMesh, VertexData
from illumcli.mesh_files.pbr import PbrMaterial

BAR = np.array([[x, y, 0] for x in range(4) for y in range(2)], float)
TRIANGLES = np.array([[2 * k, 2 * k + 2, 2 * k + 3] for k in range(3)], np.int32)


def bar(name: str = "bar", **more: Any) -> OutputMesh:
    """Three triangles in a row."""
    starts = np.array([0, 3, 6, 9], np.int32)
    return OutputMesh(name, BAR, TRIANGLES.ravel(), starts, TRIANGLES, {"uv": BAR[:, :2]}, **more)


def written(path: Path, *meshes: OutputMesh) -> dict[str, Any]:
    """The JSON of a GLB with values that count the vertices."""
    w = np.arange(8.0 * len(meshes), dtype=np.float32) / 16
    write_glb(path, meshes, VertexData({"obscurance": w}, {}), lambda image: (image.encode(), "image/png"))
    return open_document(path).json


def test_unit_rows_have_length_one_and_zero_points_up() -> None:
    rows = unit_rows(np.array([[3.0, 0, 4], [0, 0, 0]]))
    np.testing.assert_allclose(rows, [[0.6, 0, 0.8], [0, 0, 1]])


def test_groups_become_nodes_and_materials_primitives(tmp_path: Path) -> None:
    wood, clay = PbrMaterial("wood", (0.5, 0.25, 0.125), alpha=0.5), PbrMaterial("clay", emission=(0, 4, 2))
    mesh = bar(
        group_names=("left", "right"),
        triangle_groups=np.array([1, 0, 1], np.int32),
        materials=(wood, clay),
        triangle_materials=np.array([0, 1, -1], np.int32),
    )
    json = written(tmp_path / "a.glb", mesh)
    assert [node["name"] for node in json["nodes"]] == ["left", "right"]
    parts = [[each.get("material") for each in mesh["primitives"]] for mesh in json["meshes"]]
    assert parts == [[0], [None, 1]]
    assert [each["name"] for each in json["materials"]] == ["clay", "wood"]
    clay, wood = json["materials"]
    assert clay["emissiveFactor"] == [0, 1, 0.5]
    assert clay["extensions"] == {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}
    assert wood["pbrMetallicRoughness"]["baseColorFactor"] == [0.5, 0.25, 0.125, 0.5]
    assert wood["alphaMode"] == "BLEND"
    made = read_mesh(tmp_path / "a.glb")
    assert len(made.vertices) == 9  # the corners that triangles use
    np.testing.assert_allclose(
        made.attributes["_OBSCURANCE"] * 16, made.vertices[:, 0] * 2 + made.vertices[:, 1]
    )
    assert faults(tmp_path / "a.glb") == []


def test_two_objects_share_materials_and_images(tmp_path: Path) -> None:
    wood = PbrMaterial(
        "wood", textures={"base_color": "a/wood.png", "emission": "a/wood.png"}, emission=(1, 1, 1)
    )
    of_all = np.zeros(3, np.int32)
    meshes = [
        bar(name, materials=(wood,), triangle_materials=of_all, group_names=("g",), triangle_groups=of_all)
        for name in ("a", "b")
    ]
    json = written(tmp_path / "a.glb", *meshes)
    assert [node["name"] for node in json["nodes"]] == ["a.g", "b.g"]
    assert len(json["materials"]) == len(json["images"]) == len(json["textures"]) == 1
    assert json["images"][0]["name"] == "wood"
    assert json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] == {"index": 0}


def test_objects_with_different_textures_have_materials_of_their_own(tmp_path: Path) -> None:
    wood, of_all = PbrMaterial("wood"), np.zeros(3, np.int32)
    meshes = [bar(name, materials=(wood,), triangle_materials=of_all) for name in ("a", "b", "c")]
    meshes[1] = replace(meshes[1], attributes={**meshes[1].attributes, TEXTURE_UV: BAR[:, 1::-1]})
    png = png_bytes(np.zeros((2, 2, 1), np.uint8), srgb=False)
    maps = {(0, 0): OcclusionMap("a", png), (1, 0): OcclusionMap("b", png)}
    data = VertexData({"obscurance": np.zeros(24, np.float32)}, {})
    write_glb(tmp_path / "a.glb", meshes, data, lambda image: (b"", ""), OcclusionMaps(maps))
    json = open_document(tmp_path / "a.glb").json
    assert [mesh["primitives"][0]["material"] for mesh in json["meshes"]] == [0, 1, 2]
    textures = [material.get("occlusionTexture") for material in json["materials"]]
    assert textures == [{"index": 0}, {"index": 1, "texCoord": 1}, None]
    uvs = open_document(tmp_path / "a.glb").json["meshes"][1]["primitives"][0]["attributes"]
    made = stored(open_document(tmp_path / "a.glb"), uvs["TEXCOORD_1"], (2,))
    used = np.delete(BAR[:, 1::-1], 1, axis=0)
    np.testing.assert_array_equal(made, used * [1, -1] + [0, 1])
    assert faults(tmp_path / "a.glb") == []


def test_many_vertices_have_long_indices(tmp_path: Path) -> None:
    count = 65536
    vertices = np.stack([np.arange(count), np.arange(count) % 2, np.zeros(count)], axis=1).astype(float)
    triangles = np.arange(count - 1)[:, None] + [0, 1, 0]
    triangles[:, 2] = np.roll(triangles[:, 0], 1)
    mesh = OutputMesh("a", vertices, triangles.ravel(), np.arange(0, 3 * count - 2, 3), triangles, {})
    write_glb(tmp_path / "a.glb", [mesh], VertexData({}, {}), lambda image: (b"", ""))
    assert open_document(tmp_path / "a.glb").json["accessors"][-1]["componentType"] == 5125
