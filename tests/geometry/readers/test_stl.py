from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from illumcli.errors import InputError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.readers import read_mesh

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
        (binary(count=1), "announces 1 facets and holds 2"),
        (binary(count=4_000_000_000), "announces 4000000000 facets and holds 2"),
        (text()[:-12], "a.stl:16: 'ends' is not what follows"),
        (text()[: text().index("endsolid")], "ends within a solid"),
        (text()[: text().index("  endfacet")], "ends within a solid"),
        (text() + text().partition("\n")[2].partition("endsolid")[0], "ends within a solid"),
        ("solid a\n" + text(), "ends within a solid"),
        ("solid a\n" + text() + "endsolid a\n", "ends within a solid"),
        (
            text().replace("outer loop\n", "outer loop\nendsolid\nsolid\n", 1),
            "a.stl:4: 'endsolid' is not what",
        ),
        (text().replace("    endloop", "", 1), "a.stl:8: 'endfacet' is not what follows"),
        (
            text().replace("endloop", "vertex 1 2 3\nendloop", 1),
            "a.stl:7: 'vertex 1 2 3' is not what follows",
        ),
        (text().replace("endloop", "endsolid", 1), "a.stl:7: 'endsolid' is not what follows"),
        (
            text().replace("vertex 1.0 0.0", "vertex 1,0 0.0", 1),
            "a.stl:5: '1,0' is no number; write a decimal",
        ),
        (text().replace("vertex 1.0 0.0", "vertex 1.0", 1), "a.stl:5: has 2 numbers; write vertex x y z"),
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
