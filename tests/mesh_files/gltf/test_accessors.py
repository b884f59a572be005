"""Tables of numbers: sparse ones, ones of zeros, of every kind of number, and what bounds them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from illumcli.errors import InputError, LimitError
from illumcli.mesh_files import read_mesh


def make_sparse(scene: Any, accessor: int, rows: list[int], values: Any, kind: str = "u2") -> None:
    indices, replaced = scene.table(rows, kind), scene.table(values)
    views = [scene.json["accessors"][each]["bufferView"] for each in (indices, replaced)]
    scene.json["accessors"][accessor]["sparse"] = {
        "count": len(rows),
        "indices": {"bufferView": views[0], "componentType": {"u1": 5121, "u2": 5123, "u4": 5125}[kind]},
        "values": {"bufferView": views[1]},
    }


@pytest.mark.parametrize("kind", ["u1", "u2", "u4"])
def test_sparse_rows_stand_in_place_of_the_dense_ones(tmp_path: Path, square: Any, kind: str) -> None:
    scene = square()
    make_sparse(scene, 0, [1, 3], [[7, 0, 0], [0, 8, 9]], kind)
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.vertices.tolist() == [[0, 0, 0], [7, 0, 0], [1, 1, 0], [0, 8, 9]]


def test_sparse_rows_over_zeros(tmp_path: Path, square: Any) -> None:
    scene = square()
    del scene.json["accessors"][0]["bufferView"]
    make_sparse(scene, 0, [0, 1, 2], [[1, 1, 1], [2, 1, 1], [1, 2, 1]])
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.vertices.tolist() == [[1, 1, 1], [2, 1, 1], [1, 2, 1], [0, 0, 0]]


def test_an_accessor_without_data_is_zeros(tmp_path: Path, square: Any) -> None:
    scene = square()
    uv = {"componentType": 5126, "count": 4, "type": "VEC2"}
    scene.json["accessors"].append(uv)
    scene.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = 2
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.uvs is not None
    assert mesh.uvs.tolist() == [[0, 1]] * 4
    assert mesh.corner_uvs is not None
    assert mesh.corner_uvs.tolist() == mesh.corners.tolist()


def test_as_many_zeros_as_one_likes_are_refused(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.json["accessors"][0].update(count=4_000_000_000)
    del scene.json["accessors"][0]["bufferView"]
    with pytest.raises(LimitError, match="4000000000 rows and no data, the limit is 16777216; use"):
        read_mesh(scene.write(tmp_path / "a.glb"))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": 5}, "reaches beyond its buffer view"),
        ({"indices": {"bufferView": 2, "componentType": 5126}}, "5126, which is no whole number"),
        ({"indices": {"componentType": 5123}}, r"refers to bufferViews\[None\]"),
        ({"values": 3}, "has no indices and values"),
    ],
)
def test_what_is_wrong_with_sparse_rows_is_named(
    tmp_path: Path, square: Any, change: dict, message: str
) -> None:
    scene = square()
    make_sparse(scene, 0, [1], [[7, 0, 0]])
    scene.json["accessors"][0]["sparse"].update(change)
    with pytest.raises(InputError, match=message):
        read_mesh(scene.write(tmp_path / "a.glb"))


def test_sparse_rows_out_of_range_are_refused(tmp_path: Path, square: Any) -> None:
    scene = square()
    make_sparse(scene, 0, [4], [[7, 0, 0]])
    with pytest.raises(InputError, match=r"accessors\[0\].sparse replaces row 4 of 4"):
        read_mesh(scene.write(tmp_path / "a.glb"))


@pytest.mark.parametrize(
    ("kind", "code"), [("u1", 5121), ("u4", 5125), ("i2", 5122), ("i4", 5124), ("f4", 5126)]
)
def test_indices_of_every_kind(tmp_path: Path, Scene: Any, kind: str, code: int) -> None:
    scene = Scene()
    made = scene.primitive([0, 1, 2])
    made["indices"] = scene.table(np.array([0, 2, 3]).astype(kind).view("u1"), "u1")
    scene.json["accessors"][made["indices"]].update(componentType=code, count=3)
    assert read_mesh(scene.write(tmp_path / "a.glb")).corners.tolist() == [0, 2, 3]


def test_indices_between_the_vertices_are_refused(tmp_path: Path, Scene: Any) -> None:
    scene = Scene()
    scene.primitive([0, 1, 2])["indices"] = scene.table([0, 0.5, 2])
    with pytest.raises(
        InputError, match=r"meshes\[0\].primitives\[0\] has indices that are no whole numbers"
    ):
        read_mesh(scene.write(tmp_path / "a.glb"))


def test_a_stride_of_zero_is_tight(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.json["bufferViews"][0]["byteStride"] = 0
    assert read_mesh(scene.write(tmp_path / "a.glb")).vertices[2].tolist() == [1, 1, 0]


def test_quantised_positions_and_texture_coordinates(tmp_path: Path, Scene: Any) -> None:
    scene = Scene()
    made = scene.primitive([0, 1, 2])
    made["attributes"]["POSITION"] = scene.table(
        [[-32768, 0, 0], [32767, 0, 0], [0, 16384, 0]], "i2", normalized=True
    )
    made["attributes"]["TEXCOORD_0"] = scene.table([[0, 0], [3, 0], [0, 5]], "u2")
    for used, expected in ((["KHR_mesh_quantization"], 3), ([], 3 / 65535)):
        scene.json["extensionsUsed"] = used
        mesh = read_mesh(scene.write(tmp_path / "a.glb"))
        np.testing.assert_allclose(mesh.vertices[:, 0], [-1, 1, 0])
        np.testing.assert_allclose(mesh.vertices[2, 1], 16384 / 32767)
        assert mesh.uvs is not None
        np.testing.assert_allclose(mesh.uvs[1], [expected, 1])
