"""Morph targets with their default weights, and skins in their rest pose."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from illumcli.errors import InputError
from illumcli.mesh_files import read_mesh

TURN = [0, 0, np.sqrt(0.5), np.sqrt(0.5)]  # a quarter about z


def skinned(square: Any, joints: Any = None, weights: Any = None, kind: str = "u1") -> Any:
    """A square at a node moved by 100 whose vertices follow joint 0 (moved), then joint 1 (turned)."""
    scene = square()
    scene.json["meshes"][0]["primitives"][0]["attributes"] |= {
        "JOINTS_0": scene.table([[0, 0, 0, 0]] * 2 + [[1, 0, 0, 0]] * 2 if joints is None else joints, kind),
        "WEIGHTS_0": scene.table([[1, 0, 0, 0]] * 4 if weights is None else weights),
        "NORMAL": scene.table([[0.6, 0, 0.8]] * 4),
    }
    inverse = np.tile(np.eye(4), (2, 1, 1))
    inverse[1, 0, 3] = -1  # in the bind pose joint 1 stood at x = 1
    bind = scene.table(inverse.transpose(0, 2, 1).reshape(2, 16))
    scene.json["skins"] = [{"joints": [1, 2], "inverseBindMatrices": bind}]
    scene.json["nodes"] = [
        {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
        {"translation": [0, 0, 5], "children": [2]},
        {"rotation": TURN, "translation": [1, 0, 0]},
    ]
    scene.json["scenes"][0]["nodes"] = [0, 1]
    return scene


def test_a_skin_stands_where_its_joints_do_and_its_node_counts_for_nothing(
    tmp_path: Path, square: Any
) -> None:
    mesh = read_mesh(skinned(square).write(tmp_path / "a.glb"))
    # the last two vertices (1, 1, 0) and (0, 1, 0): from joint 1 (0, 1), (-1, 1), turned (-1, 0), (-1, -1)
    expected = [[0, 0, 5], [1, 0, 5], [0, 0, 5], [0, -1, 5]]
    np.testing.assert_allclose(mesh.vertices, expected, atol=1e-6)
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals[[0, 3]], [[0.6, 0, 0.8], [0, 0.6, 0.8]], atol=1e-6)


def test_weights_are_shares_of_their_sum(tmp_path: Path, square: Any) -> None:
    shares = [[1, 1, 0, 0], [2, 2, 0, 0], [0, 0, 0, 0], [0.2, 0, 0, 0]]
    scene = skinned(square, joints=[[0, 1, 0, 0]] * 4, weights=shares)
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    by_first = np.array([[0, 0, 5], [1, 0, 5], [1, 1, 5], [0, 1, 5]])
    by_second = np.array([[1, -1, 5], [1, 0, 5], [0, 0, 5], [0, -1, 5]])
    half = (by_first + by_second) / 2
    np.testing.assert_allclose(mesh.vertices, [*half[:2], *by_first[2:]], atol=1e-6)


def test_weights_may_be_bytes_and_joints_in_two_sets(tmp_path: Path, square: Any) -> None:
    scene = skinned(square)
    attributes = scene.json["meshes"][0]["primitives"][0]["attributes"]
    attributes["WEIGHTS_0"] = scene.table([[0, 0, 0, 0]] * 4, "u1", normalized=True)
    attributes["JOINTS_1"] = scene.table([[0, 1, 0, 0]] * 4, "u2")
    attributes["WEIGHTS_1"] = scene.table([[0, 255, 0, 0]] * 4, "u1", normalized=True)
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    np.testing.assert_allclose(mesh.vertices, [[1, -1, 5], [1, 0, 5], [0, 0, 5], [0, -1, 5]], atol=1e-6)


def test_without_inverse_bind_matrices_they_change_nothing(tmp_path: Path, square: Any) -> None:
    scene = skinned(square)
    del scene.json["skins"][0]["inverseBindMatrices"]
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    np.testing.assert_allclose(mesh.vertices[2:], [[0, 1, 5], [0, 0, 5]], atol=1e-6)


def test_a_mirrored_joint_turns_the_triangles_back(tmp_path: Path, square: Any) -> None:
    scene = skinned(square, joints=[[0, 0, 0, 0]] * 4)
    scene.json["nodes"][1]["scale"] = [-1, 1, 1]
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.corners.reshape(-1, 3).tolist() == [[2, 1, 0], [3, 2, 0]]
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals[0], [-0.6, 0, 0.8], atol=1e-6)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda j: j.pop("skins"), r"refers to skins\[0\], which is not there"),
        (lambda j: j["skins"][0].update(joints=[]), "has no list of joints"),
        (lambda j: j["skins"][0].update(joints=[1, 9]), r"refers to nodes\[9\]"),
        (lambda j: j["skins"][0].update(joints=[1]), "joints or weights that are not there"),
        (lambda j: j["skins"][0].update(joints=[1, 2, 1]), "has 2 inverse bind matrices for 3 joints"),
        (lambda j: j["meshes"][0]["primitives"][0]["attributes"].pop("JOINTS_0"), "without joints"),
        (lambda j: j["meshes"][0]["primitives"][0]["attributes"].pop("WEIGHTS_0"), r"accessors\[None\]"),
        (lambda j: j["accessors"][2].update(count=3), "JOINTS_0 has 3 rows for 4 vertices"),
    ],
)
def test_a_skin_that_cannot_be_read_is_left_out(
    tmp_path: Path, square: Any, change: Any, reason: str
) -> None:
    scene = skinned(square)
    change(scene.json)
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.vertices[0].tolist() == [100, 0, 0]
    with pytest.raises(AssertionError, match=rf"skins left out \(.*{reason}"):
        assert not mesh.repairs, list(mesh.repairs)


def test_joints_that_are_among_their_own_descendants(tmp_path: Path, square: Any) -> None:
    scene = skinned(square)
    scene.json["nodes"][2]["children"] = [1]
    scene.json["scenes"][0]["nodes"] = [0]
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.vertices[0].tolist() == [100, 0, 0]


def morphing(square: Any, weights: Any) -> Any:
    scene = square()
    primitive = scene.json["meshes"][0]["primitives"][0]
    primitive["attributes"]["NORMAL"] = scene.table([[0, 0, 1]] * 4)
    primitive["targets"] = [
        {"POSITION": scene.table([[0, 0, 2]] * 4)},
        {"POSITION": scene.table([[4, 0, 0]] * 4), "NORMAL": scene.table([[1.5, 0, 0]] * 4)},
    ]
    if weights is not None:
        scene.json["meshes"][0]["weights"] = weights
    return scene


def test_morph_targets_have_their_default_weights(tmp_path: Path, square: Any) -> None:
    mesh = read_mesh(morphing(square, [0.5, 0.5]).write(tmp_path / "a.glb"))
    assert mesh.vertices[:2].tolist() == [[2, 0, 1], [3, 0, 1]]
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals[0], [0.6, 0, 0.8])
    for weights in (None, [0, 0], "half", [float("nan")]):
        mesh = read_mesh(morphing(square, weights).write(tmp_path / "a.glb"))
        assert mesh.vertices[0].tolist() == [0, 0, 0]
        told = [what for what in mesh.repairs if "weights" in what]
        assert len(told) == (weights not in (None, [0, 0]))


def test_the_weights_of_a_node_come_before_those_of_its_mesh(tmp_path: Path, square: Any) -> None:
    scene = morphing(square, [0.5, 0.5])
    scene.json["nodes"][0]["weights"] = [1, 0]
    assert read_mesh(scene.write(tmp_path / "a.glb")).vertices[0].tolist() == [0, 0, 2]


def test_a_target_of_other_vertices_is_refused(tmp_path: Path, square: Any) -> None:
    scene = morphing(square, [1])
    scene.json["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] = scene.table([[0, 0, 2]] * 3)
    with pytest.raises(InputError, match="morph target 0 has 3 rows for 4 vertices"):
        read_mesh(scene.write(tmp_path / "a.glb"))
