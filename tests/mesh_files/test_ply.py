from __future__ import annotations

from pathlib import Path

import numpy as np
import plyfile
import pytest

from illumcli.errors import InputError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.repairs import HARMLESS, Repair
from illumcli.mesh_files import companions, read_mesh

FORMATS = [(True, "="), (False, "<"), (False, ">")]
XYZ = [("x", "f4"), ("y", "f4"), ("z", "f4")]
SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]

ROWS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"


def counted(mesh: Mesh) -> dict[str, int]:
    """The counts of the mesh's repairs, without harmless ones."""
    return {what: each.count for what, each in mesh.repairs.items() if what not in HARMLESS}


def written(
    path: Path, vertices: np.ndarray, lists: dict[str, tuple[str, list, str]], text: bool, order: str
) -> Path:
    """A PLY of `vertices` and elements of one list each: name -> (property, rows, type)."""
    elements = [plyfile.PlyElement.describe(vertices, "vertex")]
    for name, (label, rows, kind) in lists.items():
        table = np.empty(len(rows), [(label, "O")])
        table[label] = [np.array(row, kind) for row in rows]
        elements.append(
            plyfile.PlyElement.describe(table, name, len_types={label: "i4"}, val_types={label: kind})
        )
    plyfile.PlyData(elements, text=text, byte_order=order).write(str(path))
    return path


def head(vertices: int = 4, faces: str = "1", kind: str = "ascii", more: str = "", index: str = "int") -> str:
    return (
        f"ply\nformat {kind} 1.0\ncomment a note\nelement vertex {vertices}\n"
        f"property float x\nproperty float y\nproperty float z\n{more}"
        f"element face {faces}\nproperty list uchar {index} vertex_indices\nend_header\n"
    )


def mesh_of(tmp_path: Path, content: str | bytes) -> Mesh:
    path = tmp_path / "a.ply"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_mesh(path)


@pytest.mark.parametrize(("text", "order"), FORMATS)
@pytest.mark.parametrize("rows", [[[0, 1, 2], [0, 2, 3]], [[0, 1, 2, 3], [0, 1, 2]], [[0, 1, 2, 3]]])
def test_polygons_are_kept_in_every_format(tmp_path: Path, text: bool, order: str, rows: list) -> None:
    path = written(
        tmp_path / "a.ply", np.array(SQUARE, XYZ), {"face": ("vertex_index", rows, "u4")}, text, order
    )
    mesh = read_mesh(path)
    assert mesh.vertices.tolist() == [list(row) for row in SQUARE]
    assert [mesh.corners[a:b].tolist() for a, b in zip(mesh.starts, mesh.starts[1:], strict=False)] == rows


@pytest.mark.parametrize(("text", "order"), FORMATS)
def test_strips_alternate_and_restart(tmp_path: Path, text: bool, order: str) -> None:
    strips = [[0, 1, 2, 3, 4, -1, 2, 1, 5, -1, 0], [4, 3, 5, 5, 1]]
    vertices = np.zeros(6, XYZ)
    path = written(tmp_path / "a.ply", vertices, {"tristrips": ("vertex_indices", strips, "i4")}, text, order)
    mesh = read_mesh(path)
    assert mesh.corners.reshape(-1, 3).tolist() == [[0, 1, 2], [2, 1, 3], [2, 3, 4], [2, 1, 5], [4, 3, 5]]
    assert mesh.repairs["triangles that only join strips"].count == 2


@pytest.mark.parametrize(("text", "order"), FORMATS)
def test_every_vertex_property_is_kept(tmp_path: Path, text: bool, order: str) -> None:
    kinds = [*XYZ, ("nx", "f4"), ("ny", "f4"), ("nz", "f4"), ("s", "f4"), ("t", "f4")]
    kinds += [
        ("red", "u1"),
        ("green", "u1"),
        ("blue", "u1"),
        ("alpha", "u1"),
        ("quality", "f8"),
        ("label", "i2"),
    ]
    vertices = np.zeros(3, kinds)
    vertices["nz"] = 2
    vertices["s"], vertices["t"] = [0, 0.5, 1], [0.25, 0.5, 0.75]
    vertices["red"], vertices["green"], vertices["alpha"] = [255, 188, 0], 128, [1, 2, 3]
    vertices["quality"], vertices["label"] = [0.1, np.nan, 1e-300], [-5, 0, 30_000]
    path = written(tmp_path / "a.ply", vertices, {"face": ("vertex_indices", [[0, 1, 2]], "i4")}, text, order)
    mesh = read_mesh(path)
    assert mesh.normals is not None
    assert mesh.uvs is not None
    assert mesh.corner_normals is not None
    assert mesh.corner_uvs is not None
    assert mesh.normals.tolist() == [[0, 0, 2]] * 3
    assert mesh.uvs.tolist() == [[0, 0.25], [0.5, 0.5], [1, 0.75]]
    assert mesh.corner_normals.tolist() == mesh.corner_uvs.tolist() == [0, 1, 2]
    assert set(mesh.attributes) == {"color", "alpha", "quality", "label"}
    assert mesh.attributes["color"].dtype == np.float32
    np.testing.assert_allclose(mesh.attributes["color"][:, 0], [1, 0.5028865, 0], rtol=1e-6)
    assert mesh.attributes["alpha"].tolist() == [1, 2, 3]
    assert mesh.attributes["label"].tolist() == [-5, 0, 30_000]
    assert mesh.attributes["label"].dtype.isnative
    assert mesh.attributes["quality"].tolist() == [0.1, 0, 1e-300]
    assert counted(mesh) == {"values of 'quality' not finite, made 0": 1, "faces without area": 1}


def test_uv_per_corner_go_before_uv_per_vertex(tmp_path: Path) -> None:
    text = (
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "property float u\nproperty float v\nelement face 2\nproperty uchar flag\n"
        "property list uchar int vertex_indices\nproperty list uchar float texcoord\nend_header\n"
        "0 0 0 9 9\n1 0 0 9 9\n0 1 0 9 9\n7 3 0 1 2 6 0 0 .5 0 0 .5\n8 2 0 1 4 0 0 1 1\n"
    )
    mesh = mesh_of(tmp_path, text)
    assert mesh.uvs is not None
    assert mesh.corner_uvs is not None
    assert mesh.uvs[mesh.corner_uvs].tolist() == [[0, 0], [0.5, 0], [0, 0.5]]
    assert counted(mesh) == {"faces with fewer than three corners": 1}


def test_text_keeps_all_digits_of_a_position(tmp_path: Path) -> None:
    mesh = mesh_of(tmp_path, head() + "0.1 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n")
    assert mesh.vertices[0, 0] == 0.1


@pytest.mark.parametrize("end", [b"\r\n", b"\r"])
def test_line_ends_of_other_systems(tmp_path: Path, end: bytes) -> None:
    text = (head() + ROWS + "4 0 1 2 3\n").encode().replace(b"\n", end)
    assert mesh_of(tmp_path, text).polygon_count == 1
    body = np.array(SQUARE, "<f4").tobytes() + b"\x03" + np.array([0, 1, 2], "<i4").tobytes()
    binary = head(kind="binary_little_endian").encode().replace(b"\n", end) + body
    assert mesh_of(tmp_path, binary).vertices.tolist() == [list(row) for row in SQUARE]


def test_other_elements_are_passed_over(tmp_path: Path) -> None:
    more = "element edge 2\nproperty int vertex1\nproperty list uchar short marks\n"
    assert mesh_of(tmp_path, head(more=more) + ROWS + "1 2 5 6\n7 0\n4 0 1 2 3\n").polygon_count == 1
    body = np.array(SQUARE, ">f4").tobytes() + b"\0\0\0\1\2\0\5\0\6" + b"\0\0\0\7\0" + b"\3\0\1\2"
    binary = head(kind="binary_big_endian", more=more, index="uchar").encode() + body
    assert mesh_of(tmp_path, binary).corners.tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("solid\n", "no PLY header"),
        ("ply\nformat ascii 1.0\nelement vertex 3\n", "no PLY header"),
        ("ply\nelement vertex 0\nend_header\n", "no format line"),
        (head(vertices=-1) + ROWS, "a.ply:4: 'element vertex -1'"),
        (head(more="property quad w\n"), "a.ply:8: 'property quad w'"),
        (head(more="element vertex 3\n"), "a.ply:8: element 'vertex' is announced twice"),
        (head(more="element stuff 3\n"), "element 'stuff' has no properties"),
        (head(faces="0") + ROWS, "a.ply: has no faces"),
        (head().replace("face", "edge") + ROWS + "4 0 1 2 3\n", "a.ply: has no faces"),
        (head().replace("float z", "float w") + ROWS + "4 0 1 2 3\n", "no vertices with x, y and z"),
        (
            head(more="property list uchar int nx\nproperty int ny\nproperty int nz\n") + ROWS,
            "announces 5 rows",
        ),
        (head() + ROWS, "announces 5 rows and has 4"),
        (head(faces="4000000000") + ROWS + "4 0 1 2 3\n", "announces 4000000004 rows and has 5"),
        ("ply\nformat text 1.0\nend_header\n", "a.ply:2: 'format text 1.0' is no line"),
        (head().replace("list uchar int", "uchar") + ROWS + "4\n", "'face' has no list 'vertex_indices'"),
        (head() + ROWS + "4 0 1 2 4\n", "a.ply:15: face 0 has the index 4, there are 4 vertices"),
        (head(faces="2") + ROWS + "3 0 1 2\n3 0 -5 1\n", "a.ply:16: face 1 has the index -5"),
        (head() + ROWS + "4 0 1 2\n", "a.ply:15: face 0 has fewer values in 'vertex_indices'"),
        (head() + ROWS + "-1 0 1 2 3\n", "a.ply:15: face 0 has fewer values"),
        (head() + ROWS + "nan 0 1 2 3\n", "a.ply:15: face 0 has fewer values"),
        (head() + ROWS + "3 0 1 2.5\n", "a.ply:15: face 0 has the index 2.5, no whole number"),
        (head() + ROWS.replace("1 1 0", "1 1") + "3 0 1 2\n", "a.ply:13: vertex 2 has no value for 'z'"),
        (
            head() + ROWS.replace("1 1 0", "1,5 1 0") + "3 0 1 2\n",
            "a.ply:13: '1,5' is no number; write a decimal",
        ),
        (head() + ROWS.replace("1 1 0", "nan 1 0") + "3 0 1 2\n", "1 of 4 vertices .* the first is number 3"),
        (head() + ROWS.replace("1 1 0", "1e19 1 0") + "3 0 1 2\n", "1 of 4 vertices"),
    ],
)
def test_what_is_wrong_in_text_is_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        mesh_of(tmp_path, text)
    assert "; " in str(caught.value)


def binary(body: bytes, faces: str = "1") -> bytes:
    return head(kind="binary_little_endian", faces=faces).encode() + np.array(SQUARE, "<f4").tobytes() + body


def row(*indices: int) -> bytes:
    return bytes([len(indices)]) + np.array(indices, "<i4").tobytes()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (binary(row(0, 1, 2), faces="4000000000"), "announces 4000000000 of element 'face' and ends before"),
        (head(vertices=4_000_000_000, kind="binary_big_endian").encode() + b"\0" * 99, "of element 'vertex'"),
        (binary(row(0, 1, 2)[:-1]), "announces 1 of element 'face' and ends before number 1"),
        (binary(row(0, 1, 2) + row(0, 1, 2, 3)[:-1], faces="2"), "ends before number 2"),
        (binary(row(0, 1, 2) + row(0, 1, 2, 3), faces="3"), "ends before number 3"),
        (binary(row(0, 1, 77)), "face 0 has the index 77, there are 4 vertices"),
        (binary(row(0, 1, 2) + row(0, 1, -1, 2), faces="2"), "face 1 has the index -1"),
        (binary(b"\xff" + row(0, 1, 2)[1:]).replace(b"uchar", b"char"), "announces a list of -1"),
    ],
)
def test_what_is_wrong_in_binary_is_named(tmp_path: Path, content: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message):
        mesh_of(tmp_path, content)


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e19])
def test_binary_vertices_that_are_not_finite_are_refused(tmp_path: Path, value: float) -> None:
    vertices = np.array([(0, 0, 0), (1, 0, value), (0, 1, 0)], XYZ)
    path = written(tmp_path / "a.ply", vertices, {"face": ("vertex_index", [[0, 1, 2]], "i4")}, False, "<")
    with pytest.raises(InputError, match=r"1 of 3 vertices .* the first is number 2"):
        read_mesh(path)


def test_strips_with_an_index_out_of_range_are_refused(tmp_path: Path) -> None:
    for index in (3, -2):
        lists = {"tristrips": ("vertex_indices", [[0, 1, 2], [0, 1, index]], "i4")}
        path = written(tmp_path / "a.ply", np.zeros(3, XYZ), lists, False, "<")
        with pytest.raises(InputError, match=f"tristrips 1 has the index {index}, there are 3"):
            read_mesh(path)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_an_element_of_no_rows_is_as_good_as_none(tmp_path: Path, kind: str) -> None:
    header = (
        f"ply\nformat {kind} 1.0\nelement edge 0\nproperty int a\nproperty list uchar int b\n"
        "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    )
    order = ">" if kind.endswith("big_endian") else "<"
    body = np.array([0, 0, 0, 1, 0, 0, 0, 1, 0], f"{order}f4").tobytes() + b"\3"
    body += np.array([0, 1, 2], f"{order}i4").tobytes()
    text = b"0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    assert mesh_of(tmp_path, header.encode() + (text if kind == "ascii" else body)).polygon_count == 1


def test_a_list_whose_length_is_cut_off_is_refused(tmp_path: Path) -> None:
    header = head(vertices=3, kind="binary_little_endian").replace("list uchar", "list uint")
    header = header.replace("element face 1", "element face 1\nproperty list uchar uchar flags")
    body = np.zeros(9, "<f4").tobytes() + b"\4" + b"\0" * 4
    with pytest.raises(InputError, match="ends before number 1; the file is cut off"):
        mesh_of(tmp_path, header.encode() + body)


def test_colours_in_floats_are_linear(tmp_path: Path) -> None:
    more = "property float red\nproperty float green\nproperty float blue\n"
    content = head(vertices=3, more=more) + "0 0 0 .5 0 1\n1 0 0 .5 0 1\n0 1 0 .5 0 1\n3 0 1 2\n"
    assert mesh_of(tmp_path, content).attributes["color"].tolist() == [[0.5, 0, 1]] * 3


NAMES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kind", ["ascii", "binary_big_endian"])
def test_every_name_of_a_type_is_known(tmp_path: Path, name: str, kind: str) -> None:
    header = head(vertices=3, kind=kind, more=f"property {name} mark\n").encode()
    types = np.dtype([("p", ">f4", 3), ("mark", f">{NAMES[name]}")])
    rows = np.array([((0, 0, 0), 7), ((1, 0, 0), 8), ((0, 1, 0), 9)], types)
    body = rows.tobytes() + b"\3" + np.array([0, 1, 2], ">i4").tobytes()
    text = b"0 0 0 7\n1 0 0 8\n0 1 0 9\n3 0 1 2\n"
    mark = mesh_of(tmp_path, header + (text if kind == "ascii" else body)).attributes["mark"]
    assert mark.tolist() == [7, 8, 9]
    assert mark.dtype.kind == NAMES[name][0]


@pytest.mark.parametrize(
    ("name", "value", "kept"), [("uchar", 256, 255), ("char", -129, -128), ("uchar", 1.4, 1), ("uint", -1, 0)]
)
def test_numbers_in_text_are_made_to_fit_their_type(
    tmp_path: Path, name: str, value: float, kept: int
) -> None:
    text = head(vertices=3, more=f"property {name} mark\n") + f"0 0 0 1\n1 0 0 {value}\n0 1 0 3\n3 0 1 2\n"
    mesh = mesh_of(tmp_path, text)
    assert mesh.attributes["mark"].tolist() == [1, kept, 3]
    assert mesh.repairs == {"values that do not fit their type, rounded": Repair(1, ":13")}


def sheet(tmp_path: Path, content: str | bytes) -> dict[str, Repair]:
    """The repairs of a file that must hold the square."""
    mesh = mesh_of(tmp_path, content)
    assert mesh.vertices.tolist() == [list(row) for row in SQUARE]
    assert mesh.corners.tolist() == [0, 1, 2, 3]
    return dict(mesh.repairs)


FACE = "4 0 1 2 3\n"


def test_what_stands_behind_a_row_or_the_last_is_left_out(tmp_path: Path) -> None:
    rows = ROWS.replace("1 1 0", "1 1 0 9") + "4 0 1 2 3 255 0 0\n"
    assert sheet(tmp_path, head() + rows) == {"values behind the end of a row left out": Repair(2, ":13")}
    more = {"lines behind the last row left out": Repair(2, ":16")}
    assert sheet(tmp_path, head() + ROWS + FACE + "\n1 2 3\n4\n") == {
        what: Repair(each.count, ":17") for what, each in more.items()
    }
    assert sheet(tmp_path, "\ufeff" + head() + ROWS + FACE + "\0") == {
        "byte order marks left out": Repair(1, ":1"),
        "NUL and Ctrl-Z behind the text left out": Repair(1, ":16"),
    }
    body = row(0, 1, 2, 3) + b"trailer"
    found = sheet(tmp_path, binary(body))
    place = f": byte {len(binary(body)) - 6}"
    assert found == {"bytes behind the last row left out": Repair(7, place)}


def test_rows_may_go_on_in_the_next_line_if_all_values_are_there(tmp_path: Path) -> None:
    what = "rows that are no lines, read value by value"
    assert sheet(tmp_path, head() + "0 0 0 1 0 0\n1 1\n0 0 1 0 4\n0 1 2 3\n") == {what: Repair(1, ":11")}
    for wrong in ("0 0 0 1 0 0\n1 1\n0 0 1 0 4\n0 1 2\n", "0 0 0 1 0 0\n1 1\n0 0 1 0 4\n0 1 2 3 4\n"):
        with pytest.raises(InputError, match="announces 5 rows and has 4"):
            mesh_of(tmp_path, head() + wrong)


def test_words_among_the_numbers_matter_where_a_face_needs_them(tmp_path: Path) -> None:
    more = "property float worn\nproperty uchar mark\n"
    rows = "0 0 0 none 1\n1 0 0 1 x\n1 1 0 2 3\n0 1 0 3 4\n"
    mesh = mesh_of(tmp_path, head(vertices=5, more=more) + rows + "x 0 0 0 1\n4 0 1 2 3\n")
    assert mesh.attributes["worn"].tolist() == [0, 1, 2, 3, 0]
    assert mesh.attributes["mark"].tolist() == [1, 0, 3, 4, 1]
    assert mesh.repairs == {
        "values that do not fit their type, rounded": Repair(1, ":14"),
        "unused vertices that are not finite, made 0": Repair(1, ":17"),
        "values of 'worn' not finite, made 0": Repair(1, ":13"),
        "unused vertices": Repair(1, ":17"),
    }
    with pytest.raises(InputError, match=r"a\.ply:17: 'x' is no number"):
        mesh_of(tmp_path, head(vertices=5, more=more) + rows + "x 0 0 0 1\n4 0 1 2 4\n")


def test_the_header_may_be_written_in_many_ways(tmp_path: Path) -> None:
    plain = head()
    for header in (
        plain.replace("\n", "  \n"),
        plain.replace("int", "INT").replace("float", "Float64"),
        plain.replace("ascii 1.0", "ascii"),
        plain.replace("format ascii 1.0\n", "").replace("element face", "format ascii 1.0\nelement face"),
        plain.replace("element vertex 4", "element vertex 4 points"),
        plain.replace("int", "int64").replace("uchar", "ulong"),
    ):
        assert sheet(tmp_path, header + ROWS + FACE) == {}
    assert sheet(tmp_path, plain.replace("comment", "written by") + ROWS + FACE) == {
        "unknown lines of the header left out": Repair(1, ":3")
    }
    assert sheet(tmp_path, plain.replace("\n", "\n \t")[:-2] + ROWS + FACE) == {
        "blanks before lines of the header": Repair(8, ":2")
    }
    assert sheet(tmp_path, plain.replace("int", "float").replace("uchar", "double") + ROWS + FACE) == {
        "lengths of lists in floats": Repair(1, ":9"),
        "indices in floats": Repair(1, ":9"),
    }


@pytest.mark.parametrize("order", ["<", ">"])
def test_counts_and_indices_may_be_floats_in_bytes(tmp_path: Path, order: str) -> None:
    kind = "binary_little_endian" if order == "<" else "binary_big_endian"
    header = head(kind=kind, index="double", faces="2").replace("uchar", "float").encode()
    points = np.array(SQUARE, f"{order}f4").tobytes()

    def face(*indices: float) -> bytes:
        return np.array([len(indices)], f"{order}f4").tobytes() + np.array(indices, f"{order}f8").tobytes()

    mesh = mesh_of(tmp_path, header + points + face(0, 1, 2, 3) + face(0, 1, 2))
    assert mesh.corners.tolist() == [0, 1, 2, 3, 0, 1, 2]
    for wrong in (0.5, np.nan, -1, 9):
        with pytest.raises(InputError, match="face 1 has the index"):
            mesh_of(tmp_path, header + points + face(0, 1, 2) + face(0, 1, wrong))
    length = np.array([np.nan], f"{order}f4").tobytes()
    with pytest.raises(InputError, match="announces a list of nan"):
        mesh_of(tmp_path, header + points + length + face(0, 1, 2, 3) + face(0, 1, 2))


def test_a_mac_file_of_bytes_may_begin_with_a_line_feed(tmp_path: Path) -> None:
    header = (
        "ply\nformat binary_little_endian 1.0\nelement tag 1\nproperty uchar a\nelement vertex 4\n"
        "property float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    ).replace("\n", "\r")
    found = sheet(tmp_path, header.encode() + b"\n" + np.array(SQUARE, "<f4").tobytes() + row(0, 1, 2, 3))
    assert found == {"rows of other elements left out": Repair(1, ":3")}


def test_lists_of_vertices_and_colours_of_faces_are_counted(tmp_path: Path) -> None:
    text = head(more="property list uchar int tags\nproperty list uchar int s\n").replace(
        "end_header", "property uchar red\nend_header"
    )
    rows = "0 0 0 0 0\n1 0 0 1 5 0\n1 1 0 0 1 7\n0 1 0 2 7 8 0\n4 0 1 2 3 255\n"
    assert sheet(tmp_path, text + rows) == {
        "colours of faces left out": Repair(1, ":12"),
        "lists of vertices left out": Repair(2, ":8"),
    }


def test_a_property_named_twice_is_kept_under_another_name(tmp_path: Path) -> None:
    more = "property uchar pad\nproperty uchar pad\nproperty uchar pad\n"
    mesh = mesh_of(tmp_path, head(vertices=3, more=more) + "0 0 0 1 2 3\n1 0 0 1 2 3\n0 1 0 1 2 3\n3 0 1 2\n")
    assert {name: values[0] for name, values in mesh.attributes.items()} == {"pad": 1, "pad_2": 2, "pad_3": 3}
    assert mesh.repairs == {"properties named twice, renamed": Repair(2, ":9")}


def test_a_list_of_another_name_may_hold_the_corners(tmp_path: Path) -> None:
    found = sheet(tmp_path, head().replace("vertex_indices", "vertices") + ROWS + FACE)
    assert found == {"lists of another name taken for the corners of faces": Repair(1, ":9")}


@pytest.mark.parametrize(
    ("kind", "value"), [("uchar", 188), ("int", 188), ("ushort", 188), ("ushort", 48316), ("float", 188)]
)
def test_colours_of_wide_types_may_be_bytes(tmp_path: Path, kind: str, value: int) -> None:
    more = "".join(f"property {kind} {name}\n" for name in ("red", "green", "blue"))
    rows = "".join(f"{place} {value} 0 0\n" for place in ("0 0 0", "1 0 0", "0 1 0"))
    color = mesh_of(tmp_path, head(vertices=3, more=more) + rows + "3 0 1 2\n").attributes["color"]
    np.testing.assert_allclose(color, [[0.5028865, 0, 0]] * 3, rtol=1e-3)


TEXTURED = (
    "ply\nformat ascii 1.0\ncomment TextureFile one.png\ncomment TextureFile two  blanks.png\n"
    "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 2\n"
    "property list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int texnumber\n"
    f"end_header\n{ROWS}3 0 1 2 6 0 0 1 0 1 1 1\n3 0 2 3 6 0 0 1 1 0 1 0\n"
)


def test_images_named_in_comments_are_materials(tmp_path: Path) -> None:
    for name in ("one.png", "two  blanks.png"):
        (tmp_path / name).touch()
    mesh = mesh_of(tmp_path, TEXTURED)
    assert mesh.material_names == ("one.png", "two  blanks.png")
    assert mesh.polygon_materials is not None
    assert mesh.polygon_materials.tolist() == [1, 0]
    for name in mesh.material_names:
        texture = {"texture": str(tmp_path / name)}
        assert mesh.materials[name] == {"model": "lambert", "diffuse": texture}
        assert tmp_path / name in companions(tmp_path / "a.ply")
    assert mesh.repairs == {}


def test_images_that_are_not_there_are_counted(tmp_path: Path) -> None:
    what = "textures that are not there left out"
    assert mesh_of(tmp_path, TEXTURED).repairs == {what: Repair(2, ":3")}
    assert mesh_of(tmp_path, TEXTURED).materials == {}
    elsewhere = mesh_of(tmp_path, TEXTURED.replace("one.png", "/etc/passwd"))
    assert list(elsewhere.repairs) == ["textures outside the folder of the mesh left out", what]
    (tmp_path / "two  blanks.png").touch()
    assert mesh_of(tmp_path, TEXTURED).materials["one.png"] == {"model": "lambert"}
    bare = mesh_of(tmp_path, TEXTURED.replace("float texcoord", "float other"))
    assert bare.repairs == {"textures without coordinates left out": Repair(1, ":3")}
    short = mesh_of(tmp_path, TEXTURED.replace("3 0 1 2 6 0 0 1 0 1 1", "3 0 1 2 4 0 0 1 0"))
    assert short.repairs["texture coordinates of faces left out"] == Repair(1, ":11")
