from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from illumcli.errors import InputError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.repairs import Repair
from illumcli.mesh_files import read_mesh

TRIANGLES = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [0.1, 1e-20, 3], [0, 1, 0]]])


def text(triangles: np.ndarray = TRIANGLES) -> str:
    lines = ["solid a part"]
    for triangle in triangles.tolist():
        lines += ["  facet normal 0 0 1", "    outer loop"]
        lines += [f"      vertex {x!r} {y!r} {z!r}" for x, y, z in triangle]
        lines += ["    endloop", "  endfacet"]
    return "\n".join([*lines, "endsolid a part\n"])


def binary(
    triangles: np.ndarray = TRIANGLES, title: bytes = b"made by hand", count: int | None = None
) -> bytes:
    facets = np.zeros(len(triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("other", "<u2")])
    facets["corners"] = triangles
    announced = len(triangles) if count is None else count
    return title.ljust(80, b"\0") + np.uint32(announced).tobytes() + facets.tobytes()


def mesh_of(tmp_path: Path, content: str | bytes) -> Mesh:
    path = tmp_path / "a.stl"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_mesh(path)


def test_text_keeps_every_corner_and_digit(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, text())
    assert np.array_equal(mesh.vertices.reshape(-1, 3, 3), TRIANGLES)
    assert mesh.corners.tolist() == [0, 1, 2, 3, 4, 5]
    assert mesh.starts.tolist() == [0, 3, 6]
    assert mesh.normals is None


def test_binary_keeps_every_corner(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, binary())
    assert np.array_equal(mesh.vertices.reshape(-1, 3, 3), TRIANGLES.astype(np.float32))
    assert mesh.polygon_count == 2


@pytest.mark.parametrize("title", [b"solid", b"solid facet normal 0 0 1", b"solid ".ljust(80)])
def test_binary_may_begin_as_text_does(tmp_path: Path, title: bytes) -> None:
    assert mesh_of(tmp_path, binary(title=title)).polygon_count == 2


def test_text_may_be_in_capitals_and_hold_several_solids(tmp_path: Path) -> None:
    assert mesh_of(tmp_path, (text().upper() + "\r\n" + text()).replace("\n", "\r\n")).polygon_count == 4


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("solid a\nendsolid a\n", "has no faces"),
        (binary(TRIANGLES[:0]), "has no faces"),
        (b"not a mesh", "is no STL file, it has 10 bytes"),
        (binary()[:-1], "announces 2 facets and holds 1.98"),
        (binary(title=b"solid")[:-1], "announces 2 facets and holds 1.98"),
        (binary(count=3), "announces 3 facets and holds 2"),
        (binary(count=4_000_000_000), "announces 4000000000 facets and holds 2"),
        (text()[: text().rindex("endloop")], "a.stl: ends within a facet; the file is cut off"),
        (text()[: text().rindex("vertex")], "a.stl: ends within a facet"),
        (text()[: text().rindex("    outer")], "a.stl: ends within a facet"),
        ("vertex 0 0 0\n" + text(), "a.stl:1: a vertex stands outside of any facet"),
        (
            text().replace("endloop", "endloop\nvertex 1 2 3\nendloop", 1),
            "a.stl:8: a vertex stands outside of any facet",
        ),
        (
            text().replace("vertex 1.0 0.0", "vertex 1,0 0.0", 1),
            "a.stl:5: '1,0' is no number; write a decimal",
        ),
        (text().replace("vertex 1.0 0.0", "vertex 1.0", 1), "a.stl:5: has 2 numbers, not 3"),
        (text().replace("vertex 1.0", "vertex nan", 1), "1 of 6 vertices .* the first is number 2"),
        (binary(np.where(TRIANGLES == 3, np.inf, TRIANGLES)), "1 of 6 vertices .* the first is number 5"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, content: str | bytes, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        mesh_of(tmp_path, content)
    assert "; " in str(caught.value)


def test_a_signalling_nan_is_refused_as_any_other(tmp_path: Path) -> None:
    content = bytearray(binary())
    content[96:100] = b"\x01\x00\xa0\x7f"
    with pytest.raises(InputError, match=r"1 of 6 vertices .* the first is number 1"):
        mesh_of(tmp_path, bytes(content))


def both(tmp_path: Path, content: str | bytes) -> dict[str, Repair]:
    """The repairs of a file that must hold the two triangles."""
    mesh = mesh_of(tmp_path, content)
    assert np.array_equal(mesh.vertices.reshape(-1, 3, 3).astype("f4"), TRIANGLES.astype("f4"))
    assert mesh.starts.tolist() == [0, 3, 6]
    return dict(mesh.repairs)


LEFT_OUT = "lines that are no part of a facet left out"


@pytest.mark.parametrize(
    ("content", "repairs"),
    [
        ("# tool\n\n; note\n" + text(), {LEFT_OUT: Repair(2, ":1")}),
        (text().replace("  facet", "color 1 0 0\n  facet"), {LEFT_OUT: Repair(2, ":2")}),
        (text()[: text().rindex("endsolid")], {"solids without an end": Repair(1, ":1")}),
        (
            text()[: text().rindex("  endfacet")],
            {"solids without an end": Repair(1, ":1"), "facets without an end": Repair(1, ":9")},
        ),
        (text().replace("    endloop\n", "", 1), {"loops without an end": Repair(1, ":3")}),
        (
            text().replace("  endfacet\n", ""),
            {"facets without an end": Repair(2, ":2")},
        ),
        (text().replace("endloop", "end loop"), {"ends written in two words": Repair(2, ":7")}),
        (
            text()
            .replace("endloop", "end loop")
            .replace("endfacet", "END facet")
            .replace("endsolid", "end solid"),
            {"ends written in two words": Repair(5, ":7")},
        ),
        (
            text().partition("\n")[2].replace("endsolid a part\n", ""),
            {"facets outside of a solid": Repair(2, ":2")},
        ),
        (
            text().replace("vertex 1.0 0.0 0.0", "vertex 1.0E+00 0 0 7 red", 1),
            {"numbers behind a vertex left out": Repair(1, ":5")},
        ),
        (text().replace("normal 0 0 1", "normal -nan(ind) nan"), {}),
        (text().replace("    outer loop\n", ""), {}),
        (text().replace("solid a part", "solid"), {}),
        (text().replace("solid a part", "solid vertex outer loop"), {}),
        (" ".join(text().partition("\n")[2].split()[:-3]), {"facets outside of a solid": Repair(2, ":1")}),
        ("solid a\n" + text().partition("\n")[2].replace("\n", "\t ").replace("endsolid", "\nendsolid"), {}),
        (" ".join(text().split()), {}),
        (text().replace("\n", "\r"), {}),
        ("\ufeff" + text(), {"byte order marks left out": Repair(1, ":1")}),
        (text() + "\0\0", {"NUL and Ctrl-Z behind the text left out": Repair(2, ":17")}),
        (binary() + b"x", {"bytes behind the last facet left out": Repair(1, ": byte 185")}),
        (binary() + binary()[84:], {"bytes behind the last facet left out": Repair(100, ": byte 185")}),
        (binary(count=0), {"facets that are not announced": Repair(2, ": facet 1")}),
        (binary(title=b"made COLOR=\1\2\3\4"), {"colours of facets left out": Repair(2, ": facet 1")}),
        (binary()[:-1] + b"\x80", {"colours of facets left out": Repair(1, ": facet 2")}),
        (binary()[:-2] + b"\1\0", {}),
    ],
)
def test_what_is_put_right_is_counted(
    tmp_path: Path, content: str | bytes, repairs: dict[str, Repair]
) -> None:
    assert both(tmp_path, content) == repairs


def test_loops_of_other_sizes_are_polygons_or_dropped(tmp_path: Path) -> None:
    quad = text().replace("    endloop", "vertex 0 0 5\n    endloop", 1)
    assert mesh_of(tmp_path, quad).starts.tolist() == [0, 4, 7]
    line = text().replace("      vertex 0.0 0.0 0.0\n", "", 1)
    mesh = mesh_of(tmp_path, line)
    assert mesh.starts.tolist() == [0, 3]
    assert mesh.repairs["faces with fewer than three corners"] == Repair(1, ":3")


@pytest.mark.parametrize(
    "words", ["facet " * 200_000, "vertex " * 200_000, "solid " * 200_000, "end " * 200_000]
)
def test_words_that_repeat_take_no_time(tmp_path: Path, words: str) -> None:
    with pytest.raises(InputError):
        mesh_of(tmp_path, "solid a\nfacet\n" + words)
