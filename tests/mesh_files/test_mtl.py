from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.repairs import HARMLESS, Repair
from illumcli.mesh_files import companions, read_mesh
from illumcli.models.blinn_phong import BlinnPhong

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def counted(mesh: Mesh) -> dict[str, int]:
    """The counts of the mesh's repairs, without harmless ones."""
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
        BlinnPhong.model_validate(dict(material))


def test_what_a_material_leaves_out_is_left_to_the_model(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, "newmtl a\nKd 0.5\n# Kd 1 1 1\nPr 0.3\n")
    assert mesh.materials == {
        "a": {"model": "blinn_phong", "diffuse": (0.5, 0.5, 0.5), "specular": (0, 0, 0)}
    }


def test_a_texture_replaces_the_colour(tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    (tmp_path / "images" / "my wood.png").touch()
    mesh = mesh_of(tmp_path, "newmtl a\nKd 1 1 1\nmap_Kd -clamp on images\\my wood.png\n")
    texture = mesh.materials["a"]["diffuse"]
    assert texture == {"texture": str(tmp_path / "images" / "my wood.png"), "wrap": "clamp"}
    BlinnPhong.model_validate(dict(mesh.materials["a"]))


def test_what_the_model_has_no_word_for_is_counted_with_its_line(tmp_path: Path) -> None:
    (tmp_path / "w.png").touch()
    mesh = mesh_of(
        tmp_path,
        "newmtl a\nKd 0.5 0.5 0.5\nmap_Kd -s 2 2 2 -o 1 w.png\nd 0.5\nillum 5\nNi 1.5\nTf 1 1 1\n"
        "newmtl b\nmap_Kd /etc/v.png\nTr 0.2\nKs spectral a.rfl\nnewmtl c\nmap_Kd ../v.png\nKe 1 2\n"
        "map_Ks w.png\nbump w.png\nPr 0.4\nnonsense\n",
    )
    assert mesh.material_repairs == {
        "texture options left out": Repair(1, "a.mtl:3"),
        "spectral and XYZ colours left out": Repair(1, "a.mtl:11"),
        "images of materials other than map_Kd left out": Repair(2, "a.mtl:15"),
        "statements of materials that have no meaning here left out": Repair(2, "a.mtl:17"),
        "factors Kd of a texture left out": Repair(1, "a.mtl:2"),
        "reflection of materials left out": Repair(1, "a.mtl:5"),
    }
    assert mesh.repairs == {
        "textures outside the folder of the mesh left out": Repair(2, "a.mtl:9"),
        "colours of two numbers, the first taken for all": Repair(1, "a.mtl:14"),
        "transparent materials made opaque": Repair(2, "a.mtl:4"),
    }
    assert mesh.materials["a"]["diffuse"] == {"texture": str(tmp_path / "w.png")}


def test_a_missing_library_is_counted(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, "newmtl a\n", name="absent.mtl")
    assert counted(mesh) == {"material libraries that are not there left out": 1}
    assert mesh.materials == {}


def test_names_of_libraries_may_hold_blanks_or_be_several(tmp_path: Path) -> None:
    (tmp_path / "b c.mtl").write_text("newmtl b\n")
    assert set(mesh_of(tmp_path, "newmtl a\n", name="b c.mtl").materials) == {"b"}
    (tmp_path / "d.mtl").write_text("newmtl d\n")
    assert set(mesh_of(tmp_path, "newmtl a\n", name="a.mtl d.mtl").materials) == {"a", "d"}


OUTSIDE = [
    "../x.mtl",
    "/etc/passwd",
    "link.mtl",
    "folder/../../x.mtl",
    "C:\\x.mtl",
    "..\\x.mtl",
    "deep/x.mtl",
    "/" * 5000,
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a library outside and links that lead to it."""
    folder = tmp_path / "meshes"
    folder.mkdir()
    (tmp_path / "x.mtl").write_text("newmtl secret\n")
    (folder / "link.mtl").symlink_to(tmp_path / "x.mtl")
    (folder / "deep").symlink_to(tmp_path)
    return folder


@pytest.mark.parametrize("name", OUTSIDE)
def test_a_library_outside_the_folder_is_left_out(
    folder: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    opened = []
    real = Path.open
    monkeypatch.setattr(
        Path, "open", lambda path, *way, **more: opened.append(path) or real(path, *way, **more)
    )
    mesh = mesh_of(folder, "newmtl a\n", name=name)
    assert mesh.materials == {}
    (what,) = counted(mesh)
    assert re.fullmatch(r"material libraries (outside the folder .*|that are not there) left out", what)
    assert mesh.repairs[what] == Repair(1, ":1")
    assert {path.name for path in opened} == {"a.obj", "a.mtl"}  # the latter is written


@pytest.mark.parametrize(
    "name", ["../a.mtl", "/elsewhere/a.mtl", "C:\\elsewhere\\a.mtl", "deep/a.mtl", "no/a.mtl"]
)
def test_one_elsewhere_stands_for_that_of_its_name_beside_the_mesh(folder: Path, name: str) -> None:
    mesh = mesh_of(folder, "newmtl a\nmap_Kd D:\\art\\w.png\n", name=name)
    assert set(mesh.materials) == {"a"}
    library, texture = counted(mesh)
    assert "replaced by those of the same name in it" in library
    assert texture == "textures outside the folder of the mesh left out"
    (folder / "w.png").touch()
    textured = mesh_of(folder, "newmtl a\nmap_Kd D:\\art\\w.png\n", name=name)
    assert textured.materials["a"]["diffuse"] == {"texture": str(folder / "w.png")}


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: path.symlink_to(path)])
def test_a_library_that_is_no_regular_file_is_left_out(tmp_path: Path, make: Callable[[Path], None]) -> None:
    make(tmp_path / "b.mtl")
    mesh = mesh_of(tmp_path, "newmtl a\n", name="b.mtl")
    assert mesh.materials == {}
    assert sum(counted(mesh).values()) == 1


def test_an_empty_library_is_counted(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, "")
    assert mesh.repairs == {"material libraries that are empty or cannot be read": Repair(1, "a.mtl")}


def test_a_library_in_a_folder_of_the_mesh_has_its_textures_there_or_beside_the_mesh(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    library = "newmtl a\nmap_Kd one.png\nnewmtl b\nmap_Kd two.png\nnewmtl c\nmap_Kd ../two.png\nNs -1\n"
    (tmp_path / "in" / "b.mtl").write_text(library)
    (tmp_path / "in" / "one.png").touch()
    (tmp_path / "two.png").touch()
    mesh = mesh_of(tmp_path, "", name="in/b.mtl")
    files = [Path(mesh.materials[name]["diffuse"]["texture"]).resolve() for name in "abc"]
    assert files == [tmp_path / "in" / "one.png", tmp_path / "two.png", tmp_path / "two.png"]
    assert {each.first for each in mesh.repairs.values()} == {"in/b.mtl:4", "in/b.mtl:7"}


def test_a_mesh_that_is_a_link_finds_its_library_beside_the_link(tmp_path: Path) -> None:
    (tmp_path / "store").mkdir()
    (tmp_path / "store" / "mesh").write_text(f"mtllib a.mtl\n{TRIANGLE}")
    (tmp_path / "b.obj").symlink_to(tmp_path / "store" / "mesh")
    (tmp_path / "a.mtl").write_text("newmtl a\n")
    assert set(read_mesh(tmp_path / "b.obj").materials) == {"a"}


NUMBERS = "values of materials that are no numbers from 0 to 1e+18 left out"


@pytest.mark.parametrize(
    ("library", "what", "line"),
    [
        ("Kd 1 1 1\nnewmtl a\n", "statements before any material left out", 1),
        ("newmtl a\nKd 0,5 1 1\n", NUMBERS, 2),
        ("newmtl a\nKd -1 1 1\n", NUMBERS, 2),
        ("newmtl a\nKd nan 1 1\n", NUMBERS, 2),
        ("newmtl a\nNs 1.1e18\n", NUMBERS, 2),
        ("newmtl a\n\nNs\n", NUMBERS, 3),
        ("newmtl a\nd # half\n", NUMBERS, 2),
        ("newmtl a\nmap_Kd -clamp on\n", "textures that are not there left out", 2),
        ("newmtl a\nmap_Kd\n", "textures that are not there left out", 2),
        ("newmtl a\nnewmtl b\nnewmtl a\n", "materials that are defined twice, joined", 3),
    ],
)
def test_a_statement_that_makes_no_sense_is_left_out_and_named(
    tmp_path: Path, library: str, what: str, line: int
) -> None:
    mesh = mesh_of(tmp_path, library)
    assert mesh.repairs == {what: Repair(1, f"a.mtl:{line}")}
    assert mesh.materials["a"] == {"model": "blinn_phong", "specular": (0, 0, 0)}


def test_layout_and_capitals_do_not_matter(tmp_path: Path) -> None:
    plain = "newmtl a b\nKd 0.1 0.2 0.3\nNs 10\nd 1\nillum 1\n"
    said = mesh_of(tmp_path, plain).materials
    for library in (
        "\ufeff# by hand\n" + plain,
        plain.replace("\n", "\r\n"),
        plain.replace("\n", "\r"),
        plain.replace(" ", "\t").replace("a\tb", "a b"),
        plain.replace("\n", "   # note\n"),
        plain.replace("10", "10# sharp") + "\0\x1a",
        plain.upper().replace("A B", "a b"),
    ):
        mesh = mesh_of(tmp_path, library)
        assert (mesh.materials, counted(mesh)) == (said, {})


def test_names_may_be_in_latin_1(tmp_path: Path) -> None:
    (tmp_path / "é.mtl").write_bytes("newmtl gr\xfcn\nKd 0 1 0\nmap_Kd bl\xe4tter.png\n".encode("latin-1"))
    (tmp_path / "blätter.png").touch()
    (tmp_path / "a.obj").write_bytes(f"mtllib \xe9.mtl\nusemtl gr\xfcn\n{TRIANGLE}".encode("latin-1"))
    mesh = read_mesh(tmp_path / "a.obj")
    assert mesh.material_names == tuple(mesh.materials) == ("grün",)
    assert mesh.materials["grün"]["diffuse"] == {"texture": str(tmp_path / "blätter.png")}


@pytest.mark.parametrize(
    ("said", "name"),
    [
        ("two  blanks.png", "two  blanks.png"),
        (" -o 1 -clamp on my 2 wood.png", "my 2 wood.png"),
        ("-s 1 1 1  7.png", "7.png"),
        ('"my wood.png"', "my wood.png"),
        ("wood.png # oak", "wood.png"),
        ("wood #3.png", "wood #3.png"),
        ("-BM 0.5 -Clamp ON wood.png", "wood.png"),
        ("in\\wood.png", "in/wood.png"),
    ],
)
def test_the_name_of_a_texture_is_what_follows_its_options(tmp_path: Path, said: str, name: str) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / name).touch()
    mesh = mesh_of(tmp_path, f"newmtl a\nmap_Kd {said}\n")
    assert mesh.materials["a"]["diffuse"]["texture"] == str(tmp_path / name)
    assert counted(mesh) == {}
    assert tmp_path / name in companions(tmp_path / "a.obj")


def test_a_texture_that_is_not_there_leaves_the_colour(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, "newmtl a\nKd 1 0 0\nmap_Kd no.png\n")
    assert mesh.materials["a"]["diffuse"] == (1, 0, 0)
    assert mesh.repairs == {"textures that are not there left out": Repair(1, "a.mtl:3")}


@pytest.mark.parametrize(
    "option",
    ["-blendu on", "-blendv off", "-boost 1", "-bm 1", "-cc on", "-clamp off", "-imfchan r", "-texres 64",
     "-type sphere", "-mm 0 1", "-o 1", "-s 1 2", "-t 1 2 3"],
)  # fmt: skip
def test_options_of_a_texture_are_counted_and_no_part_of_its_name(tmp_path: Path, option: str) -> None:
    (tmp_path / "wood.png").touch()
    mesh = mesh_of(tmp_path, f"newmtl a\nNs 1e18\nmap_Kd {option} wood.png\n")
    assert mesh.materials["a"]["diffuse"] == {"texture": str(tmp_path / "wood.png")}
    assert mesh.materials["a"]["exponent"] == 1e18
    assert mesh.material_repairs == {"texture options left out": Repair(1, "a.mtl:3")}


def test_opaque_materials_of_all_light_are_not_counted(tmp_path: Path) -> None:
    assert counted(mesh_of(tmp_path, "newmtl a\nd 1\nTr 0\nillum 2\n")) == {}
    assert "transparent" in str(mesh_of(tmp_path, "newmtl a\nd 0.999\n").repairs)
