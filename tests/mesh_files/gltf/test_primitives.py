"""Primitives: modes, indices that name no vertex, flat normals, attributes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from illumcli.geometry.corner_normals import corner_normals
from illumcli.geometry.mesh import Mesh
from illumcli.mesh_files import read_mesh


def triangles(mesh: Mesh) -> list[list[int]]:
    return mesh.corners.reshape(-1, 3).tolist()


def test_a_primitive_without_positions_is_skipped_and_counted(tmp_path: Path, square: Any) -> None:
    scene = square()
    bad = scene.primitive([0, 1, 2])
    bad["attributes"] = {"_T": bad["attributes"]["POSITION"]}
    scene.primitive([1, 2, 3])["attributes"] = 7
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.polygon_count == 2
    told = mesh.repairs["primitives without POSITION, left out"]
    assert (told.count, told.first) == (2, ": meshes[0].primitives[1]")


def test_primitives_without_normals_are_flat(tmp_path: Path, Scene: Any) -> None:
    scene = Scene()
    gutter, faces = [[0, 0, 0], [1, 0, 0], [0.5, 1, 0.1], [0.5, -1, 0.1]], [0, 1, 2, 1, 0, 3]
    scene.primitive(faces)["attributes"]["POSITION"] = scene.table(gutter)
    smooth = scene.primitive(faces, NORMAL=scene.table([[0, 0, 1]] * 4))
    smooth["attributes"]["POSITION"] = scene.table(gutter)
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.polygon_smoothing is not None
    assert mesh.polygon_smoothing.tolist() == [0, 0, -1, -1]
    found = corner_normals(mesh)
    own = found.normals[found.index].reshape(-1, 3, 3)
    y, z = np.array([0.1, 1]) / np.hypot(0.1, 1)
    for corner in range(3):
        np.testing.assert_allclose(own[:, corner], [[0, -y, z], [0, y, z], [0, 0, 1], [0, 0, 1]], atol=1e-7)


def test_triangles_of_vertices_that_are_not_there_are_left_out(tmp_path: Path, Scene: Any) -> None:
    scene = Scene()
    scene.primitive([0, 1, 2, 0, 1, 4, 0, 2, 3, 3])
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert triangles(mesh) == [[0, 1, 2], [0, 2, 3]]
    assert mesh.repairs["triangles of vertices that are not there, left out"].count == 1
    assert mesh.repairs["corners behind the last whole triangle"].count == 1


def test_restart_values_end_strips_and_fans(tmp_path: Path, Scene: Any) -> None:
    scene = Scene()
    scene.primitive([0, 1, 2, 65535, 1, 2, 3], mode=5)
    scene.primitive([0, 1, 2, 3, 65535, 3, 1, 2], mode=6)
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert triangles(mesh) == [[0, 1, 2], [1, 2, 3], [4, 5, 6], [4, 6, 7], [7, 5, 6]]


def test_primitives_of_an_unknown_mode_are_counted(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.primitive([0, 1, 2], mode=7)
    scene.primitive([0, 1, 2])["mode"] = "TRIANGLES"
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.polygon_count == 2
    assert mesh.repairs["primitives of an unknown mode, left out"].count == 2


@pytest.mark.parametrize(
    ("name", "values"),
    [("NORMAL", [[0, 0, 1]] * 3), ("TEXCOORD_0", [[0, 0, 1]] * 4), ("COLOR_0", [1, 1, 1, 1]), ("_W", [1, 2])],
)
def test_attributes_that_cannot_be_read_are_left_out(
    tmp_path: Path, square: Any, name: str, values: Any
) -> None:
    scene = square()
    scene.json["meshes"][0]["primitives"][0]["attributes"][name] = scene.table(values)
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.polygon_count == 2
    assert mesh.repairs[f"{name} that cannot be read, left out"].first == ": meshes[0].primitives[0]"


@pytest.mark.parametrize("width", [3, 4])
@pytest.mark.parametrize(
    ("kind", "top", "normalized"),
    [("f4", 1, False), ("u1", 255, True), ("u2", 65535, True), ("u1", 255, False)],
)
def test_colours_are_linear_fractions(
    tmp_path: Path, square: Any, width: int, kind: str, top: int, normalized: bool
) -> None:
    scene = square()
    values = np.array([[0, 1, 0, 1], [1, 0, 0, 0], [0, 0, 1, 1], [1, 1, 1, 0]])[:, :width] * top
    table = scene.table(values, kind, normalized=normalized)
    scene.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = table
    attributes = read_mesh(scene.write(tmp_path / "a.glb")).attributes
    assert attributes["color"].tolist() == [[0, 1, 0], [1, 0, 0], [0, 0, 1], [1, 1, 1]]
    assert ("alpha" in attributes) == (width == 4)


def test_primitives_without_colours_are_white_beside_others(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.primitive([0, 1, 2], COLOR_0=scene.table([[1, 0, 0, 0.5]] * 4))
    attributes = read_mesh(scene.write(tmp_path / "a.glb")).attributes
    assert attributes["color"].tolist() == [[1, 1, 1]] * 4 + [[1, 0, 0]] * 4
    assert attributes["alpha"].tolist() == [1] * 4 + [0.5] * 4


def test_places_of_repairs_name_the_primitive(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.primitive([0, 1, 2, 3, 3, 3])
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.repairs["faces without area"].first == ": meshes[0].primitives[1], face 2"
    assert mesh.repairs == {"faces without area": mesh.repairs["faces without area"]}


def test_a_node_flattened_to_a_plane(tmp_path: Path, square: Any) -> None:
    scene = square()
    scene.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = scene.table([[0.6, 0, 0.8]] * 4)
    scene.json["nodes"][0]["scale"] = [1e12, 1e12, 0]
    mesh = read_mesh(scene.write(tmp_path / "a.glb"))
    assert mesh.normals is not None
    np.testing.assert_allclose(mesh.normals, [[0, 0, 1]] * 4)
