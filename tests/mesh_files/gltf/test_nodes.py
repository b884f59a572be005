"""Transforms of nodes and their instances."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from illumcli.errors import InputError, LimitError
from illumcli.geometry.mesh import Mesh
from illumcli.mesh_files import read_mesh
from illumcli.mesh_files.gltf import nodes

HALF = np.sqrt(0.5)


def first_vertices(mesh: Mesh) -> list[list[float]]:
    """Where the corner at the origin of each square stands."""
    return mesh.vertices[::4].round(6).tolist()


def test_every_instance_is_there(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.json["meshes"][0]["primitives"][0]["attributes"] |= {
        "NORMAL": scene.table([[0, 0.6, 0.8]] * 4),
        "TEXCOORD_0": scene.table([[0, 0], [1, 0], [1, 1], [0, 1]]),
        "COLOR_0": scene.table([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    }
    attributes = {
        "TRANSLATION": scene.table([[0, 0, 0], [5, 0, 0], [0, 0, 7]]),
        "ROTATION": scene.table(np.array([[0, 0, 0, 1], [0, 0, HALF, HALF], [0, 0, 0, 1]]) * 127, "i1"),
        "SCALE": scene.table([[1, 1, 1], [2, 2, 2], [-1, 1, 1]]),
        "_ID": scene.table([1, 2, 3]),
    }
    scene.json["nodes"][0] |= {
        "translation": [100, 0, 0],
        "extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}},
    }
    path = scene.write(tmp_path / "a.glb")
    mesh = read_mesh(path)
    plain, turned, mirrored = mesh.vertices.reshape(3, 4, 3).round(6).tolist()
    assert plain == [[100, 0, 0], [101, 0, 0], [101, 1, 0], [100, 1, 0]]
    assert turned == [[105, 0, 0], [105, 2, 0], [103, 2, 0], [103, 0, 0]]
    assert mirrored == [[100, 0, 7], [99, 0, 7], [99, 1, 7], [100, 1, 7]]
    assert mesh.corners.reshape(-1, 3).tolist()[2:] == [[4, 5, 6], [4, 6, 7], [10, 9, 8], [11, 10, 8]]
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals[::4], [[0, 0.6, 0.8], [-0.6, 0, 0.8], [0, 0.6, 0.8]], atol=1e-6)
    assert mesh.uvs is not None
    assert len(mesh.uvs) == 12
    assert mesh.attributes["color"][5].tolist() == [1, 0, 0]


def test_instances_of_a_translation_alone(tmp_path: Path, square: Any) -> None:
    scene = square()
    said = {"attributes": {"TRANSLATION": scene.table([[0, 0, 0], [0, 3, 0]])}}
    scene.json["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": said}
    assert first_vertices(read_mesh(scene.write(tmp_path / "a.glb"))) == [[0, 0, 0], [0, 3, 0]]


def test_instances_that_lack_a_part_are_left_out(tmp_path: Path, square: Any) -> None:
    scene = square()
    said = {
        "TRANSLATION": scene.table([[0, 0, 0], [0, 3, 0], [0, 6, 0]]),
        "SCALE": scene.table([[1, 1, 1]] * 2),
    }
    scene.json["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": said}}
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert first_vertices(mesh) == [[0, 0, 0], [0, 3, 0]]
    assert mesh.repairs["instances that lack a part of their transform, left out"].first == ": nodes[0]"


def test_instances_beyond_the_limits_are_refused(
    tmp_path: Path, square: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = square()
    said = {"attributes": {"TRANSLATION": scene.table([[0, 0, np.nan], [0, 3, 0]])}}
    scene.json["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": said}
    path = scene.write(tmp_path / "a.glb")
    with pytest.raises(InputError, match=r"nodes\[0\] has instances whose place is not finite"):
        read_mesh(path)
    monkeypatch.setattr(nodes, "MOST_INSTANCES", 1)
    with pytest.raises(LimitError, match=r"nodes\[0\] has 2 instances, the limit is 1"):
        read_mesh(path)


def test_a_node_with_two_parents_stands_at_both(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.json["nodes"] = [
        {"mesh": 0},
        {"children": [0], "translation": [1, 0, 0]},
        {"children": [0], "translation": [2, 0, 0]},
    ]
    scene.json["scenes"][0]["nodes"] = [1, 2]
    path = scene.write(tmp_path / "a.glb")
    assert first_vertices(read_mesh(path)) == [[1, 0, 0], [2, 0, 0]]


def test_ways_through_the_nodes_are_limited(
    tmp_path: Path, square: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = square()
    scene.json["nodes"] = [*({"children": [i + 1, i + 1]} for i in range(60)), {"mesh": 0}]
    monkeypatch.setattr(nodes, "MOST_NODES", 1000)
    with pytest.raises(LimitError, match="places more than 1000 nodes"):
        read_mesh(scene.write(tmp_path / "a.glb"))


def test_a_deep_line_of_nodes(tmp_path: Path, square: Any) -> None:
    scene = square()
    deep = 20_000
    scene.json["nodes"] = [{"children": [i + 1], "translation": [0, 0, 1]} for i in range(deep)]
    scene.json["nodes"].append({"mesh": 0})
    assert first_vertices(read_mesh(scene.write(tmp_path / "a.glb"))) == [[0, 0, deep]]


def test_a_circle_of_nodes_is_refused(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.json["nodes"] = [{"children": [1]}, {"children": [2]}, {"mesh": 0, "children": [1]}]
    with pytest.raises(InputError, match=r"nodes\[1\] is among its own descendants"):
        read_mesh(scene.write(tmp_path / "a.glb"))


def test_roots_with_a_parent_or_listed_twice_are_drawn_once(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.json["nodes"] = [{"children": [1], "translation": [4, 0, 0]}, {"mesh": 0}]
    scene.json["scenes"][0]["nodes"] = [1, 0, 0]
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert first_vertices(mesh) == [[4, 0, 0]]
    assert mesh.repairs["roots of the scene listed twice or with a parent"].count == 2


def test_scenes_that_are_not_there(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.json["scene"] = 5
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.repairs["default scene that is not there, the first taken"].count == 1
    scene.json["scenes"] = []
    assert read_mesh(scene.write(tmp_path / "a.glb")).polygon_count == 2


def test_meshes_without_nodes_stand_as_they_are(tmp_path: Path, square: Any) -> None:
    scene = square()
    for key in ("nodes", "scenes", "scene"):
        del scene.json[key]
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.polygon_count == 2
    assert mesh.group_names == ("mesh 0",)


def test_hidden_nodes_are_left_out_with_all_below(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.json["nodes"] = [
        {"children": [1], "extensions": {"KHR_node_visibility": {"visible": False}}},
        {"mesh": 0},
        {"mesh": 0, "translation": [9, 0, 0], "extensions": {"KHR_node_visibility": {"visible": True}}},
    ]
    scene.json["scenes"][0]["nodes"] = [0, 2]
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert first_vertices(mesh) == [[9, 0, 0]]
    assert mesh.repairs["hidden nodes, left out with all below them"].first == ": nodes[0]"


def test_transforms_that_are_wrong_are_counted(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.json["nodes"] = [
        {"mesh": 0, "rotation": [0, 0, 0, 0], "translation": [1, 0, 0]},
        {"mesh": 0, "matrix": [1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 0, 2, 0, 0, 1]},
    ]
    scene.json["scenes"][0]["nodes"] = [0, 1]
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert first_vertices(mesh) == [[1, 0, 0], [2, 0, 0]]
    assert mesh.repairs["rotations of no length, left out"].first == ": nodes[0]"
    assert mesh.repairs["matrices whose last row is not 0 0 0 1, taken for it"].first == ": nodes[1]"
