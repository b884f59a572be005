"""OBJ files with values: the lines of another OBJ, and meshes of other formats."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from illumcli.color import from_srgb, to_srgb
from illumcli.mesh_files import read_mesh
from illumcli.mesh_files.color_change import COLOR_CHANGES
from illumcli.mesh_files.mtl_write import left_out, mtl_lines
from illumcli.mesh_files.obj_write import NamedMesh, extend_obj, read_about, write_obj
from illumcli.mesh_files.output_mesh import VertexData

TEXT = """\
# a comment
o left side
v 0 0 0
  v 1.50 0 0 # behind
v 1 1 \\
0
v 0 1 0
vt 0 0
vn 0 0 1
g side
usemtl red wood
s 1
f 1/1/1 2//1 3/1
s off
f -4 -2 -1
l 1 2
"""


def values(count: int, **more) -> VertexData:
    """Values in eighths."""
    return VertexData({"obscurance": np.arange(count, dtype=np.float32) / 8}, {"content": "c"}, **more)


def test_the_lines_of_an_obj_are_kept(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(TEXT)
    extend_obj(tmp_path / "b.obj", tmp_path / "a.obj", read_mesh(tmp_path / "a.obj"), values(4))
    lines = (tmp_path / "b.obj").read_text().splitlines()
    kept = TEXT.replace("v 0 0 0", "v 0 0 0 0 0 0").replace("1.50 0 0 #", "1.50 0 0 0.125 0.125 0.125 #")
    kept = kept.replace("v 1 1 \\\n0", "v 1 1 0 0.25 0.25 0.25").replace(
        "v 0 1 0", "v 0 1 0 0.375 0.375 0.375"
    )
    assert lines[:-1] == kept.splitlines()
    assert read_about(tmp_path / "b.obj")["content"] == "c"

    # again: the colours are replaced, and there is one line about the bake
    mesh = read_mesh(tmp_path / "b.obj")
    extend_obj(tmp_path / "c.obj", tmp_path / "b.obj", mesh, values(4))
    assert (tmp_path / "c.obj").read_text().splitlines()[:-1] == lines[:-1]


@pytest.mark.parametrize("end", ["\r\n", "\r", "\n"])
def test_line_ends_are_kept(tmp_path: Path, end: str) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    (tmp_path / "a.obj").write_bytes(text.replace("\n", end).encode())
    extend_obj(tmp_path / "b.obj", tmp_path / "a.obj", read_mesh(tmp_path / "a.obj"), values(3))
    kept = "\r\n" if end == "\r\n" else "\n"  # carriage returns alone become line feeds
    head = kept.join(["v 0 0 0 0 0 0", "v 1 0 0 0.125 0.125 0.125", "v 0 1 0 0.25 0.25 0.25", "f 1 2 3", ""])
    assert (tmp_path / "b.obj").read_bytes().startswith(head.encode())


def test_values_change_the_colours_as_asked(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0 1 0.5 0\nv 1 0 0 1 0.5 0\nv 0 1 0\nf 1 2 3\n")
    mesh = read_mesh(tmp_path / "a.obj")
    for name, wanted in {
        "b": [[1, 0.5, 0], [1, 0.5, 0.125], [1, 1, 0.25]],
        "replace": [[0, 0, 0], [0.125] * 3, [0.25] * 3],
        "multiply": [[0, 0, 0], to_srgb(from_srgb(np.array([1, 0.5, 0])) / 8), to_srgb(np.full(3, 0.25))],
    }.items():
        extend_obj(tmp_path / "b.obj", tmp_path / "a.obj", mesh, values(3, color=COLOR_CHANGES[name]))
        rows = [line.split()[4:] for line in (tmp_path / "b.obj").read_text().splitlines()[:3]]
        np.testing.assert_allclose(np.array(rows, float), wanted, atol=1e-6)


def test_meshes_are_read_back_as_they_were(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(TEXT)
    mesh = read_mesh(tmp_path / "a.obj")
    write_obj(tmp_path / "b.obj", [NamedMesh("one", mesh), NamedMesh("two", mesh)], values(8), "b.mtl")
    written = read_mesh(tmp_path / "b.obj")
    assert written.group_names == ("one", "side", "two")
    assert written.material_names == ("red wood",)
    for name in ("vertices", "normals", "uvs"):
        np.testing.assert_array_equal(getattr(written, name), np.tile(getattr(mesh, name), (2, 1)))
    for name in ("corners", "corner_uvs", "corner_normals", "polygon_smoothing"):
        first, second = np.split(getattr(written, name), 2)
        np.testing.assert_array_equal(first, getattr(mesh, name))
        assert name == "polygon_smoothing" or (second[first >= 0] > first[first >= 0]).all()
    assert (tmp_path / "b.obj").read_text().startswith("mtllib b.mtl\no one\n")


def test_metallic_roughness_as_mtl() -> None:
    plain = {"model": "metallic_roughness", "base_color": (1.0, 0.5, 0.0), "metallic": 0.5, "roughness": 0.5}
    texture = {"texture": "a.png", "space": "linear"}
    textured = {
        "model": "metallic_roughness",
        "base_color": {"texture": "b.png"},
        "metallic": {**texture, "channel": "b"},
        "roughness": {**texture, "channel": "g", "factor": (0.25, 0.25, 0.25)},
        "ior": 2.0,
    }
    lines = list(mtl_lines({"plain": plain, "textured": textured}, lambda texture: texture))
    assert lines == [
        "newmtl plain",
        "Kd 1 0.5 0",
        "Ks 0.52 0.27 0.02",
        "Ns 30",
        "Pr 0.5",
        "Pm 0.5",
        "illum 2",
        "newmtl textured",
        "Kd 1 1 1",
        "map_Kd b.png",
        "Ks 0.111111 0.111111 0.111111",
        "Ns 510",
        "Pr 0.25",
        "Pm 0",
        "illum 2",
    ]
    assert left_out({"plain": plain}) == []
    assert left_out({"plain": plain, "textured": textured}) == ["textures of metal and roughness"]


def test_materials_as_mtl() -> None:
    measured = {
        "model": "cook_torrance",
        "ambient": {"texture": "a.glb#images[0]", "factor": (0.5, 0.5, 0.5), "wrap": "clamp"},
        "diffuse": (0.1, 0.1, 0.1),
        "distribution": {"D": "ggx", "alpha": 0.25},
        "fresnel": {"F": "schlick", "f0": (0.04, 0.04, 0.04)},
        "emission": (1.0, 0.0, 0.0),
    }
    phong = {
        "model": "blinn_phong",
        "diffuse": (0.25, 0.5, 1.0),
        "specular": (0.5, 0.5, 0.5),
        "exponent": 8.0,
    }
    assert list(mtl_lines({"a b": measured, "c": phong, "d": {}}, lambda texture: "x.png")) == [
        "newmtl a b",
        "Kd 0.5 0.5 0.5",
        "map_Kd -clamp on x.png",
        "Ks 0.04 0.04 0.04",
        "Ns 30",
        "Pr 0.5",
        "Ke 1 0 0",
        "illum 2",
        "newmtl c",
        "Kd 0.25 0.5 1",
        "Ks 0.5 0.5 0.5",
        "Ns 8",
        "illum 2",
        "newmtl d",
        "Kd 0.8 0.8 0.8",
        "Ks 0 0 0",
        "illum 2",
    ]
