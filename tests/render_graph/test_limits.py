"""The memory that a scene is expected to take."""

from __future__ import annotations

import numpy as np
import pytest

from illumcli.render_graph.limits import expected_memory
from illumcli.scene.load import load
from painted import write_picture

ALONE = "version: 1\nmeshes: {m: MESH}\nobjects: [{mesh: m, name: one}]\n"
COPIES = "version: 1\nmeshes: {m: MESH}\nobjects:\n" + "- {mesh: m, transform: {scale: [1, 2, 3]}}\n" * 50
LONG = COPIES.replace("[1, 2, 3]", "[1, 2, 4]")
TURNED = COPIES.replace(
    "scale: [1, 2, 3]", "matrix: [[1, 0, 0, 0], [3, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"
)
FLAT = COPIES.replace("[1, 2, 3]", "[1, 2, 0]")


@pytest.mark.parametrize("mesh", ["{shape: sphere}", "{file: m.obj}"])
@pytest.mark.parametrize(("text", "most"), [(COPIES, 2), (LONG, 50), (TURNED, 50), (FLAT, 50)])
def test_shared_meshes_count_once_or_twice(tmp_path, mesh, text, most):
    (tmp_path / "m.obj").write_text("v 0 0 0\n" * 1000)

    def expected(scene, **how):
        (tmp_path / "scene.yaml").write_text(scene.replace("MESH", mesh))
        loaded = load(tmp_path / "scene.yaml")
        return sum(expected_memory(loaded, loaded.scene, **how).values())

    assert expected(text) == most * expected(ALONE)
    assert expected(text, shares_meshes=False) == 50 * expected(ALONE)


def test_files_of_obscurance_count(tmp_path):
    (tmp_path / "m.obj").write_text("v 0 0 0\n" * 1000)
    (tmp_path / "w.ply").write_bytes(b"x" * 1000)
    write_picture(tmp_path / "w.png", np.zeros((20, 30, 3), np.uint8))

    def expected(file):
        (tmp_path / "scene.yaml").write_text(ALONE.replace("MESH", f"{{file: m.obj, obscurance: {file}}}"))
        loaded = load(tmp_path / "scene.yaml")
        return expected_memory(loaded, loaded.scene)

    bare = expected("m.obj")["meshes"]
    assert expected("w.ply") == {"meshes": bare + 14 * 1000}
    assert expected("w.png")["meshes"] == bare
    assert expected("w.png")["textures"] >= 20 * 30 * 3
