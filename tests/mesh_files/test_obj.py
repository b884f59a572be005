from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from illumcli.errors import InputError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.repairs import HARMLESS, Repair
from illumcli.mesh_files import _text, read_mesh

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def counted(mesh: Mesh) -> dict[str, int]:
    """The counts of the mesh's repairs, without harmless ones."""
    return {what: each.count for what, each in mesh.repairs.items() if what not in HARMLESS}


def mesh_of(tmp_path: Path, text: str | bytes) -> Mesh:
    path = tmp_path / "a.obj"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_mesh(path)


def faces(mesh: Mesh) -> list[list[int]]:
    return [mesh.corners[a:b].tolist() for a, b in zip(mesh.starts[:-1], mesh.starts[1:], strict=True)]


def test_polygons_keep_their_corners(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, SQUARE + "f 1 2 3 4\nf 1 2 3\n")
    assert faces(mesh) == [[0, 1, 2, 3], [0, 1, 2]]
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert mesh.normals is None
    assert mesh.uvs is None


def test_numbers_keep_all_their_digits(tmp_path: Path) -> None:
    rng = np.random.default_rng(7)
    values = rng.normal(size=(300, 3)) * 10.0 ** rng.integers(-17, 17, (300, 3))
    text = "".join("v " + " ".join(map(repr, row)) + "\n" for row in values.tolist())
    assert np.array_equal(mesh_of(tmp_path, text + "f 1 2 3\n").vertices, values)


@pytest.mark.parametrize("piece", [1, 64, 1 << 22])
def test_the_size_of_pieces_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, piece: int
) -> None:
    monkeypatch.setattr(_text, "PIECE", piece)
    values = np.arange(600.0).reshape(-1, 3)
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in values.tolist())
    assert np.array_equal(mesh_of(tmp_path, text + "f 1 2 3\n").vertices, values)


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_layout_of_the_text_does_not_matter(tmp_path: Path, end: str) -> None:
    text = (
        "# a comment with a backslash \\\nv 0 0 0 # the first\n\n  v\t1 0 0  \n \t \nvn 0 0 1\n"
        "v 0 1 \\\n0\nf 1 \\\n  2 \\\n  3"
    )
    mesh = mesh_of(tmp_path, text.replace("\n", end))
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert faces(mesh) == [[0, 1, 2]]


def test_corners_of_every_form_may_be_mixed(tmp_path: Path) -> None:
    text = SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nvn 0 0 -1\nf 1/1/2 2//1 3/3\nf 1 2/2/ 3// 4/1\n"
    mesh = mesh_of(tmp_path, text)
    assert faces(mesh) == [[0, 1, 2], [0, 1, 2, 3]]
    assert mesh.corner_uvs is not None
    assert mesh.corner_normals is not None
    assert mesh.corner_uvs.tolist() == [0, -1, 2, -1, 1, -1, 0]
    assert mesh.corner_normals.tolist() == [1, 0, -1, -1, -1, -1, -1]


def test_negative_indices_count_back_from_the_face(tmp_path: Path) -> None:
    text = (
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 1 0 0\nvn 0 0 1\nf -3//-1 -2//-2 -1//1\n"
        "v 5 5 5\nvn 0 1 0\nf -3//-1 -2//-1 -1//-1\n"
    )
    mesh = mesh_of(tmp_path, text)
    assert faces(mesh) == [[0, 1, 2], [1, 2, 3]]
    assert mesh.corner_normals is not None
    assert mesh.corner_normals.tolist() == [1, 0, 0, 2, 2, 2]


def test_a_face_may_stand_before_its_vertices(tmp_path: Path) -> None:
    assert faces(mesh_of(tmp_path, "f 1 2 3\n" + SQUARE)) == [[0, 1, 2]]


def test_texture_coordinates_may_have_one_to_three_numbers(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, SQUARE + "vt 0.5\nvt 0.25 0.75\nvt 1 2 3\nf 1/1 2/2 3/3\n")
    assert mesh.uvs is not None
    assert mesh.uvs.tolist() == [[0.5, 0], [0.25, 0.75], [1, 2]]


@pytest.mark.parametrize("full", [1, 255])
def test_vertex_colours_become_linear(tmp_path: Path, full: int) -> None:
    text = f"v 0 0 0 {full} 0 0\nv 1 0 0 0 {0.5 * full} 0\nv 0 1 0\nv 2 2 2 {full} {full} nan\nf 1 2 3\n"
    mesh = mesh_of(tmp_path, text)
    color = mesh.attributes["color"]
    assert color.dtype == np.float32
    np.testing.assert_allclose(color, [[1, 0, 0], [0, 0.21404114, 0], [1, 1, 1], [1, 1, 1]], rtol=1e-6)
    assert mesh.repairs["vertices without a colour, made white"] == Repair(2, ":3")


def colored(tmp_path: Path, *colors: str) -> Mesh:
    rows = [f"v {k} {k * k} 0 {color}\n" for k, color in enumerate(colors)]
    return mesh_of(tmp_path, "".join(rows) + "f 1 2 3\n")


@pytest.mark.parametrize("wrong", ["-0.001", "1.0001", "1.9", "inf", "300"])
def test_a_colour_out_of_range_is_clipped_and_changes_no_other(tmp_path: Path, wrong: str) -> None:
    """One value beyond 1 does not make bytes of all the others."""
    mesh = colored(tmp_path, "0.5 0.25 1", f"{wrong} 0.5 0", "0 1.0 0.25")
    np.testing.assert_allclose(mesh.attributes["color"][0], [0.21404114, 0.05087609, 1], rtol=1e-5)
    assert mesh.attributes["color"][1, 0] == (0 if wrong[0] == "-" else 1)
    assert mesh.repairs == {"vertex colours beyond their range, clipped": Repair(1, ":2")}


def test_bytes_are_whole_numbers_or_mostly_far_beyond_1(tmp_path: Path) -> None:
    dark = colored(tmp_path, "0 1 0", "2 0 1", "1 1 1").attributes["color"]
    assert 0 < dark.max() < 0.01
    mean = colored(tmp_path, "127.5 127.5 255", "200.5 0 0", "0 90 0").attributes["color"]
    np.testing.assert_allclose(mean[0], [0.21404114, 0.21404114, 1], rtol=1e-6)


def test_seven_numbers_are_a_place_a_colour_and_alpha(tmp_path: Path) -> None:
    mesh = colored(tmp_path, "1 0 0 1", "1 0 0 0.5", "0 1 0")
    assert mesh.attributes["color"].tolist() == [[1, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert mesh.attributes["alpha"].tolist() == [1, 0.5, 1]
    assert mesh.repairs == {}


def test_what_stands_behind_a_vertex_and_is_no_colour_is_counted(tmp_path: Path) -> None:
    rows = ["v 0 0 0 1.0", "v 1 0 0 0.5", "v 0 1 0 7 8", "v 1 1 0 1 2 3 4 5", "v 2 2 0 left over"]
    mesh = mesh_of(tmp_path, "\n".join([*rows, "f 1 2 4 5 3\n"]))
    assert mesh.vertices[:, :2].tolist() == [[0, 0], [1, 0], [0, 1], [1, 1], [2, 2]]
    assert mesh.attributes == {}
    assert mesh.repairs == {
        "numbers behind a vertex left out": Repair(3, ":3"),
        "weights of vertices left out": Repair(1, ":2"),
    }


def test_marks_of_editors_are_skipped(tmp_path: Path) -> None:
    assert faces(mesh_of(tmp_path, "\ufeff" + SQUARE + "f 1 2 3\n\0\x1a\0")) == [[0, 1, 2]]
    assert mesh_of(tmp_path, "\ufeffmtllib no.mtl\n" + SQUARE + "f 1 2 3\n\0\0").repairs == {
        "byte order marks left out": Repair(1, ":1"),
        "NUL and Ctrl-Z behind the text left out": Repair(2, ":7"),
        "material libraries that are not there left out": Repair(1, ":1"),
        "unused vertices": Repair(1, ":5"),
    }


def test_keywords_may_be_in_capitals(tmp_path: Path) -> None:
    text = SQUARE + "vt 0 0\nvn 0 0 1\ng a\nusemtl m\ns 1\nf 1/1/1 2/1/1 3/1/1\n"
    plain, capital = mesh_of(tmp_path, text), mesh_of(tmp_path, text.upper())
    assert faces(plain) == faces(capital)
    assert capital.uvs is not None
    assert capital.normals is not None
    assert (capital.group_names, capital.material_names) == (("A",), ("M",))


def test_unknown_statements_are_left_out_and_counted(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, SQUARE + "vcolor 1 0 0\nfoo\ncall b.obj\nf 1 2 3 4\n4 5 6\n")
    assert faces(mesh) == [[0, 1, 2, 3]]
    assert mesh.repairs == {
        "unknown statements left out": Repair(3, ":5"),
        "other files and commands left out": Repair(1, ":7"),
    }


def test_comments_may_follow_a_number_but_not_begin_within_a_name(tmp_path: Path) -> None:
    text = "v 0 0 0# a\nv 1 0 0 # b # c\nv 0 1 0\nvt 0 0#\nusemtl red#1 # note\nf 1/1 2/1 3/1#2\n"
    mesh = mesh_of(tmp_path, text)
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert mesh.material_names == ("red#1",)
    assert mesh.repairs == {"comments that follow a number without a blank": Repair(3, ":1")}


def test_line_ends_of_any_kind_may_be_mixed(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, "v 0 0 0\rv 1 0 0\r\nv 0 1 \\ \r\n 0\nv 1 1\t0\r\r\nf 1 2 4 3\r\nl 1 2\r\n")
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    assert mesh.repairs == {"lines left out": Repair(1, ":8")}


def test_references_to_normals_and_uv_that_are_not_there_are_dropped(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, SQUARE + "vn 0 0 1\nf 1/1/1 2/2/2 3/0/0\nf 1/-1/-1 3/3/-2 4//\n")
    assert mesh.uvs is None
    assert mesh.corner_uvs is None
    assert mesh.corner_normals is not None
    assert mesh.corner_normals.tolist() == [0, -1, -1, 0, -1, -1]
    assert mesh.repairs == {
        "references to texture coordinates that are not there dropped": Repair(5, ":6"),
        "references to normals that are not there dropped": Repair(3, ":6"),
    }
    none = mesh_of(tmp_path, SQUARE + "f 1//1 2//2 3//3 4//4\n")
    assert none.normals is None
    assert counted(none) == {"references to normals that are not there dropped": 4}


def test_normals_and_uv_without_enough_numbers_are_taken_from_the_corners(tmp_path: Path) -> None:
    """MSVC's C writes -1.#IND and nan(ind) for what is no number."""
    normals = "vn 0 1\nvn -1.#IND00 0 0\nvn 1.#QNAN 1.#INF 0\nvn -nan(ind) 0 0\nvn 0 0 1 5\n"
    uvs = "vt\nvt none 0\nvt 0.5\nvt 1 2 3\n"
    mesh = mesh_of(tmp_path, SQUARE + normals + uvs + "f 1/1/1 2/2/2 3/3/3 4/4/4\nf 1//5 2//5 3//5\n")
    assert mesh.corner_normals is not None
    assert mesh.corner_uvs is not None
    assert mesh.corner_normals.tolist() == [-1, -1, -1, -1, 4, 4, 4]
    assert mesh.corner_uvs.tolist() == [-1, -1, 2, 3, -1, -1, -1]
    assert mesh.repairs == {
        "normals not finite or of no length": Repair(4, ":5"),
        "uv not finite": Repair(2, ":10"),
    }


def test_materials_that_no_library_has_are_counted_once(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text("newmtl red\n")
    text = SQUARE + "usemtl blue\nf 1 2 3\nusemtl red\nf 1 2 3\nusemtl blue\nusemtl green\nf 1 3 4\n"
    mesh = mesh_of(tmp_path, "mtllib a.mtl\n" + text)
    assert mesh.repairs == {"materials that no library has": Repair(2, ":6")}
    assert mesh_of(tmp_path, text).repairs == {}
    absent = mesh_of(tmp_path, "mtllib b.mtl\n" + text)
    assert list(absent.repairs) == ["material libraries that are not there left out"]


def test_groups_and_materials_hold_until_the_next(tmp_path: Path) -> None:
    triangle = "f 1 2 3\n"
    text = (
        SQUARE
        + triangle
        + "o left part\nusemtl red#1\n"
        + triangle
        + "g right\n"
        + triangle
        + "usemtl blue\n"
    ) + (triangle + "s off\nusemtl red#1\nf 1 2 3 4\n")
    mesh = mesh_of(tmp_path, text)
    assert mesh.group_names == ("left part", "right")
    assert mesh.material_names == ("red#1", "blue")
    assert mesh.polygon_groups is not None
    assert mesh.polygon_materials is not None
    assert mesh.polygon_groups.tolist() == [-1, 0, 1, 1, 1]
    assert mesh.polygon_materials.tolist() == [-1, 0, 0, 1, 0]


def test_smoothing_groups_hold_until_the_next(tmp_path: Path) -> None:
    said = ["", "s 1\n", "s 7\n", "s off\n", "", "s 1\n", "s 0\n", "s 99999999999\n"]
    mesh = mesh_of(tmp_path, SQUARE + "".join(f"{each}f 1 2 3\n" for each in said) + "f 1 2\n")
    assert mesh.polygon_smoothing is not None
    assert mesh.polygon_smoothing.tolist() == [-1, 1, 2, 0, 0, 1, 0, 5]
    assert mesh_of(tmp_path, SQUARE + "f 1 2 3\n").polygon_smoothing is None


def test_short_faces_are_dropped_and_counted_with_what_belongs_to_them(tmp_path: Path) -> None:
    text = SQUARE + "vt 0 0\nvt 1 1\nusemtl a\nf 1/1 2/1\nusemtl b\nf 1/2 2/2 3/2\nf\nf 1\n"
    mesh = mesh_of(tmp_path, text)
    assert faces(mesh) == [[0, 1, 2]]
    assert counted(mesh) == {"faces with fewer than three corners": 3}
    assert mesh.corner_uvs is not None
    assert mesh.polygon_materials is not None
    assert mesh.corner_uvs.tolist() == [1, 1, 1]
    assert mesh.polygon_materials.tolist() == [1]


def test_unusable_normals_and_uv_are_taken_from_the_corners(tmp_path: Path) -> None:
    text = SQUARE + "vn nan 0 0\nvn 0 0 0\nvn 0 0 1\nvt inf 0\nf 1/1/1 2/1/2 3/1/3\n"
    mesh = mesh_of(tmp_path, text)
    assert mesh.corner_normals is not None
    assert mesh.corner_uvs is not None
    assert mesh.corner_normals.tolist() == [-1, -1, 2]
    assert mesh.corner_uvs.tolist() == [-1, -1, -1]
    assert counted(mesh) == {"normals not finite or of no length": 2, "uv not finite": 1}


def test_vertices_that_no_face_uses_may_be_anything(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, "v nan 0 0\n" + SQUARE + "v 0 1e999 0\nv 9 9 9\nf 2 3 4\n")
    assert mesh.vertices[[0, 5]].tolist() == [[0, 0, 0], [0, 0, 0]]
    assert mesh.repairs == {
        "unused vertices that are not finite, made 0": Repair(2, ":1"),
        "unused vertices": Repair(4, ":1"),
    }


@pytest.mark.parametrize("wrong", ["3.1+e2 0 0", "0 1", "", "1,5 0 0"])
def test_lines_of_vertices_that_no_face_uses_may_be_wrong(tmp_path: Path, wrong: str) -> None:
    mesh = mesh_of(tmp_path, f"v {wrong}\n" + SQUARE + "f 2 3 4\n")
    assert mesh.repairs["unused vertices that are not finite, made 0"] == Repair(1, ":1")
    with pytest.raises(InputError, match=r"a\.obj:1: .* no number|a\.obj:1: has \d numbers, not 3"):
        mesh_of(tmp_path, f"v {wrong}\n" + SQUARE + "f 1 3 4\n")


@pytest.mark.parametrize("order", ["utf-16-le", "utf-16-be"])
def test_a_text_may_be_in_utf_16(tmp_path: Path, order: str) -> None:
    mesh = mesh_of(tmp_path, ("\ufeff" + SQUARE + "usemtl grün\r\nf 1 2 3 4\nl 1 2").encode(order))
    assert mesh.material_names == ("grün",)
    assert mesh.repairs == {
        "texts in UTF-16": Repair(1, ":1"),
        "lines left out": Repair(1, ":7"),
    }


def test_shapes_that_are_no_polygons_are_counted(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, SQUARE + "l 1 2\np 1\np 2\ncurv 0 1 1 2\nf 1 2 3\n")
    assert counted(mesh) == {"lines left out": 1, "points left out": 2, "curves left out": 1}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "a.obj: has no faces"),
        ("# only\n# comments\n", "a.obj: has no faces"),
        ("some\nother file\n", "a.obj: has no faces"),
        ("v\nv\nf 1 2 1\n", "a.obj:1: has 0 numbers, not 3"),
        (SQUARE + "f 1 2 3 x\n", "a.obj:5: 'x' is no whole number"),
        ("v 0 0 \x010\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "a.obj:1: '.0' is no number"),
        (SQUARE + "l 1 2\n", "a.obj: has no faces"),
        (SQUARE + "f 1 2\n", "a.obj: has no faces"),
        ("f 1 2 3\n", "a.obj:1: index 1 is out of range, there are 0 vertices"),
        (SQUARE + "f 1 2 3\nf 1 2 5\n", "a.obj:6: index 5 is out of range, there are 4 vertices"),
        (SQUARE + "f 1 2 -5\n", "a.obj:5: index -5 is out of range"),
        (SQUARE + "\n# note\nf 0 1 2\n", "a.obj:7: index 0"),
        (SQUARE + "f 1 2 99999999999999999999999\n", "a.obj:5: index .* is out of range"),
        (SQUARE + "f 1 2 -99999999999999999999999\n", "a.obj:5: index .* is out of range"),
        (SQUARE + "f 1 2 3.0\n", "a.obj:5: '3.0' is no whole number"),
        (SQUARE + "f 1/1/1/1 2 3\n", "a.obj:5: '1/1/1/1' is no corner"),
        (SQUARE + "f 1///1 2 3\n", "a.obj:5: '1///1' is no corner"),
        (SQUARE + "f 1//2/1 2 3\n", "a.obj:5: '1//2/1' is no corner"),
        (SQUARE + "f 1 2 3\nf 1 /2 3\n", "a.obj:6: '/2' is no corner"),
        (SQUARE + "f 1 2 / 3\n", "a.obj:5: '/' is no corner"),
        (SQUARE + "f 1 2 a\n", "a.obj:5: 'a' is no whole number"),
        ("v 0 0 0\nv 1,5 0 0\nv 0 1 0\nf 1 2 3\n", "a.obj:2: '1,5' is no number; write a decimal point"),
        ("v 0 0 0\nv 1_0 0 0\nv 0 1 0\nf 1 2 3\n", "a.obj:2: '1_0' is no number"),
        ("v 0 0 0\nv 1 0\nv 0 1 0 5\nf 1 2 3\n", "a.obj:2: has 2 numbers, not 3"),
        ("v 0 0 0\nv\nv 0 1 0\nf 1 2 3\n", "a.obj:2: has 0 numbers, not 3"),
        (SQUARE + "v nan 0 0\nv 0 0 inf\nf 1 5 6\n", "a.obj: 2 of 6 vertices .* the first is number 5"),
        (SQUARE + "v 0 0 2e18\nf 1 2 5\n", "a.obj: 1 of 5 vertices .* beyond 1e"),
        (SQUARE + "v 0 0 1e999\nf 1 2 -1\n", "a.obj: 1 of 5 vertices"),
        ("v 0 0 \\\n0\nv 1 0 0\nv 0 x 0\nf 1 2 3\n", "a.obj:4: 'x' is no number"),
    ],
)
def test_what_is_wrong_is_named_with_its_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message.replace("a.obj", r"a\.obj")) as caught:
        mesh_of(tmp_path, text)
    assert "; " in str(caught.value)  # the way out


def test_colours_on_every_vertex_need_no_repair(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 0 1 0\nf 1 2 3\n")
    assert mesh.attributes["color"].tolist() == [[1, 0, 0], [1, 0, 0], [0, 1, 0]]
    assert counted(mesh) == {}


@pytest.mark.parametrize("corner", ["/", "//", "/ /"])
def test_corners_of_slashes_alone_are_refused(tmp_path: Path, corner: str) -> None:
    """Found by coverage-guided fuzzing: no number in any face."""
    with pytest.raises(InputError, match=r"a\.obj:5: '/+' is no corner of a face; write v, v/vt"):
        mesh_of(tmp_path, f"{SQUARE}f {corner}\n")
