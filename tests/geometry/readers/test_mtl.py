from __future__ import annotations

import os
from pathlib import Path

import pytest

from illumcli.errors import InputError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.readers import read_mesh
from illumcli.geometry.repairs import HARMLESS
from illumcli.models.blinn_phong import BlinnPhong

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def counted(mesh: Mesh) -> dict[str, int]:
    """What the mesh's repairs count, without what is harmless."""
    return {what: each.count for what, each in mesh.repairs.items() if what not in HARMLESS}


def mesh_of(tmp_path: Path, library: str, name: str = "a.mtl") -> Mesh:
    (tmp_path / "a.mtl").write_text(library)
    (tmp_path / "a.obj").write_text(f"mtllib {name}\n{TRIANGLE}")
    return read_mesh(tmp_path / "a.obj")


def test_illum_chooses_the_terms(tmp_path: Path) -> None:
    values = "Ka 0.1 0.2 0.3\nKd 0.4 0.5 0.6\nKs 0.7 0.8 0.9\nKe 1 2 3\nNs 10\n"
    library = "".join(f"newmtl illum {i}\n{values}illum {i}\n" for i in range(3))
    mesh = mesh_of(tmp_path, library)
    assert counted(mesh) == {}
    assert mesh.materials["illum 2"] == {
        "model": "blinn_phong",
        "ambient": (0.1, 0.2, 0.3),
        "diffuse": (0.4, 0.5, 0.6),
        "specular": (0.7, 0.8, 0.9),
        "emission": (1, 2, 3),
        "exponent": 10,
    }
    assert mesh.materials["illum 1"] == {**mesh.materials["illum 2"], "specular": (0, 0, 0)}
    assert mesh.materials["illum 0"]["emission"] == (0.4, 0.5, 0.6)
    assert all(mesh.materials["illum 0"][key] == (0, 0, 0) for key in ("diffuse", "specular", "ambient"))
    for material in mesh.materials.values():
        BlinnPhong.validated(dict(material))


def test_what_a_material_leaves_out_is_left_to_the_model(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, "newmtl a\nKd 0.5\n# Kd 1 1 1\nPr 0.3\n")
    assert mesh.materials == {
        "a": {"model": "blinn_phong", "diffuse": (0.5, 0.5, 0.5), "specular": (0, 0, 0)}
    }


def test_a_texture_replaces_the_colour(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, "newmtl a\nKd 1 1 1\nmap_Kd -clamp on images\\my wood.png\n")
    texture = mesh.materials["a"]["diffuse"]
    assert texture == {"texture": str(tmp_path / "images" / "my wood.png"), "wrap": "clamp"}
    BlinnPhong.validated(dict(mesh.materials["a"]))


def test_what_the_model_has_no_word_for_is_counted(tmp_path: Path) -> None:
    mesh = mesh_of(
        tmp_path,
        "newmtl a\nKd 0.5 0.5 0.5\nmap_Kd -s 2 2 2 -o 1 w.png\nd 0.5\nillum 5\n"
        "newmtl b\nmap_Kd /etc/w.png\nTr 0.2\nKs spectral a.rfl\nnewmtl c\nmap_Kd ../w.png\n",
    )
    assert counted(mesh) == {
        "factors Kd of a texture left out": 1,
        "texture options left out": 2,
        "transparent materials made opaque": 2,
        "reflection of materials left out": 1,
        "textures outside the folder of the mesh left out": 2,
        "spectral and XYZ colours left out": 1,
    }
    assert mesh.materials["a"]["diffuse"] == {"texture": str(tmp_path / "w.png")}


def test_a_missing_library_is_counted(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, "newmtl a\n", name="absent.mtl")
    assert counted(mesh) == {"missing material library": 1}
    assert mesh.materials == {}


def test_names_of_libraries_may_hold_blanks_or_be_several(tmp_path: Path) -> None:
    (tmp_path / "b c.mtl").write_text("newmtl b\n")
    assert set(mesh_of(tmp_path, "newmtl a\n", name="b c.mtl").materials) == {"b"}
    (tmp_path / "d.mtl").write_text("newmtl d\n")
    assert set(mesh_of(tmp_path, "newmtl a\n", name="a.mtl d.mtl").materials) == {"a", "d"}


@pytest.mark.parametrize(
    "name",
    ["../x.mtl", "/etc/passwd", "link.mtl", "folder/../../x.mtl", "C:\\x.mtl", "..\\x.mtl", "deep/x.mtl"],
)
def test_a_library_outside_the_folder_is_refused(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "meshes"
    folder.mkdir()
    (tmp_path / "x.mtl").write_text("newmtl secret\n")
    (folder / "link.mtl").symlink_to(tmp_path / "x.mtl")
    (folder / "deep").symlink_to(tmp_path)
    with pytest.raises(InputError, match=r"a\.obj:1: .*(leads out of the folder|absolute path)"):
        mesh_of(folder, "newmtl a\n", name=name)


def test_a_library_that_is_no_regular_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo.mtl")
    with pytest.raises(InputError, match=r"fifo\.mtl: is no regular file"):
        mesh_of(tmp_path, "newmtl a\n", name="fifo.mtl")
    (tmp_path / "loop.mtl").symlink_to(tmp_path / "loop.mtl")
    with pytest.raises(InputError, match=r"loop\.mtl"):
        mesh_of(tmp_path, "newmtl a\n", name="loop.mtl")


def test_a_mesh_that_is_a_link_finds_its_library_beside_the_link(tmp_path: Path) -> None:
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "mesh").write_text(f"mtllib a.mtl\n{TRIANGLE}")
    (tmp_path / "b.obj").symlink_to(tmp_path / "store" / "mesh")
    (tmp_path / "a.mtl").write_text("newmtl a\n")
    assert set(read_mesh(tmp_path / "b.obj").materials) == {"a"}


@pytest.mark.parametrize(
    ("library", "message"),
    [
        ("Kd 1 1 1\n", "a.mtl:1: Kd stands before any material"),
        ("newmtl a\nKd 0,5 1 1\n", "a.mtl:2: '0,5 1 1' is no number"),
        ("newmtl a\nKd -1 1 1\n", "a.mtl:2: must be from 0"),
        ("newmtl a\nKd nan 1 1\n", "a.mtl:2: must be from 0"),
        ("newmtl a\nNs 1.1e18\n", r"a.mtl:2: must be from 0 to 1e\+18, is 1.1e18"),
        ("newmtl a\n\nNs\n", "a.mtl:3: has no number"),
        ("newmtl a\nmap_Kd -clamp on\n", "a.mtl:2: names no image"),
    ],
)
def test_a_wrong_value_is_named_with_its_line(tmp_path: Path, library: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        mesh_of(tmp_path, library)


@pytest.mark.parametrize(
    "option",
    ["-blendu on", "-blendv off", "-boost 1", "-bm 1", "-cc on", "-clamp off", "-imfchan r", "-texres 64",
     "-type sphere", "-mm 0 1", "-o 1", "-s 1 2", "-t 1 2 3"],
)  # fmt: skip
def test_options_of_a_texture_are_counted_and_no_part_of_its_name(tmp_path: Path, option: str) -> None:
    mesh = mesh_of(tmp_path, f"newmtl a\nNs 1e18\nmap_Kd {option} wood.png\n")
    assert mesh.materials["a"]["diffuse"] == {"texture": str(tmp_path / "wood.png")}
    assert mesh.materials["a"]["exponent"] == 1e18
    assert counted(mesh)["texture options left out"] == 1


def test_opaque_materials_of_all_light_are_not_counted(tmp_path: Path) -> None:
    assert counted(mesh_of(tmp_path, "newmtl a\nd 1\nTr 0\nillum 2\n")) == {}
    assert "transparent" in str(mesh_of(tmp_path, "newmtl a\nd 0.999\n").repairs)
