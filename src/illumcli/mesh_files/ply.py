"""Stanford PLY, in text and both byte orders: polygons, triangle strips, normals, uv, any vertex property.

`_ply` parses the rows, `read` interprets them. Only files whose faces cannot be determined are refused; other
faults are repaired or left out, and counted. `write` uses plyfile.

References
----------
Turk, G. (1994). The PLY polygon file format. Stanford University.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats
from illumcli.color import from_srgb, to_srgb
from illumcli.errors import InputError
from illumcli.files.atomic import AtomicFile
from illumcli.files.seal import seal
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.repairs import Repair, note
from illumcli.mesh_files import _ply
from illumcli.mesh_files._color import unit_range
from illumcli.mesh_files._companions.ply import LONGEST_HEADER
from illumcli.mesh_files._files import TAKEN, content, nearby
from illumcli.mesh_files._ply import Element, Lists, Table
from illumcli.mesh_files._ply_copy import read_copy
from illumcli.mesh_files._polygons import Ints, RawMesh, check_range, checked_mesh, starts_of, strip
from illumcli.mesh_files._text import Text
from illumcli.mesh_files.output_mesh import STANDARD, OutputMesh, VertexData, fits_single, free_name
from illumcli.mesh_files.split import SplitVertices
from illumcli.records import Value

_NORMAL = ("nx", "ny", "nz")
_UV = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"), ("texture_s", "texture_t"))
BYTE: np.dtype[Any] = np.dtype(np.uint8)
_COLORS = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"))
_CORNERS = ("vertex_indices", "vertex_index")


class _File(Value):
    """A file while it is read: its header, tables and text."""

    path: Path
    head: _ply.Header
    tables: dict[str, Table]
    text: Text | None
    repairs: dict[str, Repair] = field(default_factory=dict)

    def element(self, name: str) -> Element:
        return next(each for each in self.head.elements if each.name == name)

    def count(self, name: str) -> int:
        """Rows of the elements of a name."""
        return sum(each.count for each in self.head.elements if each.name == name)

    def line(self, element: str, name: str) -> str:
        """The line of the header that declares a property."""
        prop = next(each for each in self.element(element).properties if each.name == name)
        return f":{prop.line}"

    def place(self, part: str, index: int) -> str:
        """The place of a vertex (or its normal) or a face in the file."""
        element = {"vertex": "vertex", "normal": "vertex", "face": "face"}.get(part)
        line = None if element is None else self.row_line(element, index)
        return f": {part} {index + 1}" if line is None else f":{line}"

    def row_line(self, name: str, row: int) -> int | None:
        """The line number of a row; None if rows are not lines."""
        index = self.row_index(name, row)
        return None if index is None or self.text is None else self.text.number(index)

    def row_index(self, name: str, row: int) -> int | None:
        """The index of a row's line in the text; None if rows are not lines."""
        if self.text is None or row >= self.count(name):
            return None
        names = [element.name for element in self.head.elements]
        before = sum(element.count for element in self.head.elements[: names.index(name)])
        return int(np.searchsorted(self.text.starts, self.head.start)) + before + row


def read(path: Path) -> Mesh:
    """The faces and strips of a PLY file, and all properties of its vertices.

    `nx ny nz` become normals, and `s t`, `u v` or `texture_u texture_v` become uv, unless faces have
    `texcoord` lists. `red green blue` become the attribute `color`: integers are sRGB, floats linear. All
    other properties of vertices become attributes of the same name. Images in `TextureFile` comments become
    materials, selected by a face's `texnumber`. Numbers in text are read in full precision.
    """
    # Parse.
    data = content(path)
    repairs: dict[str, Repair] = {}
    head = _ply.header(path, data, repairs)
    columns, text = _ply.tables(path, data, head, repairs)
    file = _File(path, head, columns, text, repairs)

    # Interpret vertices and faces.
    vertex = file.tables.get("vertex", {})
    if any(isinstance(vertex.get(name, None), Lists | None) for name in "xyz"):
        raise InputError(f"{path}: has no vertices with x, y and z; export the mesh again")
    vertices = _stacked(vertex, ("x", "y", "z"))
    corners, counts, wedges = _polygons(file, len(vertices))
    _refuse_words(file, vertices, corners)

    # Normals and uv, of corners if faces have them.
    raw = RawMesh(vertices, corners, counts)
    if _has(vertex, _NORMAL):
        raw = replace(raw, normals=_stacked(vertex, _NORMAL), corner_normals=corners)
    if wedges is not None:
        raw = replace(raw, uvs=wedges, corner_uvs=np.arange(len(corners)))
    elif pair := next((pair for pair in _UV if _has(vertex, pair)), None):
        raw = replace(raw, uvs=_stacked(vertex, pair), corner_uvs=corners)
    raw = _with_materials(file, raw)
    _count_what_is_left_out(file)
    return checked_mesh(path, replace(raw, attributes=_attributes(file), repairs=repairs), file.place)


def holds_obscurance(path: Path) -> bool:
    """True if vertices have baked obscurance, in a file with a sound header.

    `quality` alone does not count: other programs write anything under this name.
    """
    with path.open("rb") as file:
        data = file.read(LONGEST_HEADER)
    vertex = [each for each in _ply.header(path, data, {}).elements if each.name == "vertex"]
    return any(prop.name == "obscurance" for each in vertex for prop in each.properties)


def _refuse_words(file: _File, vertices: NDArray[np.float64], corners: Ints) -> None:
    """Refuse the first used vertex whose coordinates are not numbers."""
    unknown: NDArray[np.bool_] = np.any(np.isnan(vertices), axis=1)
    for vertex in corners[unknown[corners]][:1].tolist():
        index = file.row_index("vertex", vertex)
        if file.text is not None and index is not None:
            line = file.text.block(np.array([index]))
            line.refuse_words(0, int(line.counts[0]))


def _has(table: Table, names: tuple[str, ...]) -> bool:
    """True if a table has all these properties, as single values."""
    return all(isinstance(table.get(name), np.ndarray) for name in names)


def _stacked(table: Table, names: tuple[str, ...]) -> NDArray[np.float64]:
    """(N, k) float64 of k single properties."""
    return np.stack([np.asarray(table[name], np.float64) for name in names], axis=1)


def _polygons(file: _File, size: int) -> tuple[Ints, Ints, NDArray[np.float64] | None]:
    """Corners, corners per polygon, and (C, 2) uv per corner if the faces have them; strips follow faces."""
    corners, counts, wedges = np.empty(0, np.int64), np.empty(0, np.int64), None
    if file.count("face"):
        corners, counts = _indices(file, "face", size)
        uvs = file.tables["face"].get("texcoord")
        if isinstance(uvs, Lists) and np.array_equal(uvs.counts, 2 * counts):
            wedges = uvs.values.astype(np.float64).reshape(-1, 2)
        elif uvs is not None:
            note(file.repairs, "texture coordinates of faces left out", file.line("face", "texcoord"))
    if file.count("tristrips"):
        indices, lengths = _indices(file, "tristrips", size, least=-1)
        triangles, joints = strip(np.insert(indices, starts_of(lengths)[1:-1], -1))
        if joints:
            note(file.repairs, "triangles that only join strips", count=joints)
        corners = np.concatenate([corners, triangles.ravel()])
        counts = np.concatenate([counts, np.full(len(triangles), 3)])
        wedges = None if len(triangles) else wedges
    return corners, counts, wedges


def _indices(file: _File, element: str, size: int, least: int = 0) -> tuple[Ints, Ints]:
    """The vertex indices of all rows of an element, at least `least`, and their number in each row."""
    # The list of indices, by its usual names.
    table = file.tables[element]
    lists = [name for name, column in table.items() if isinstance(column, Lists) and name != "texcoord"]
    name = next((name for name in (*_CORNERS, *lists) if isinstance(table.get(name), Lists)), None)
    if name is None:
        raise InputError(f"{file.path}: element '{element}' has no list 'vertex_indices'; export it with one")
    if name not in _CORNERS:
        note(file.repairs, "lists of another name taken for the corners of faces", file.line(element, name))
    lists_of_corners = table[name]
    assert isinstance(lists_of_corners, Lists)
    if any(each.name == name and each.type.kind == "f" for each in file.element(element).properties):
        note(file.repairs, "indices in floats", file.line(element, name))

    def row(position: int) -> str:
        number = int(np.searchsorted(np.cumsum(lists_of_corners.counts), position, side="right"))
        line = file.row_line(element, number)
        place = f"{file.path}" if line is None else f"{file.path}:{line}"
        return f"{place}: {element} {number} has the index {lists_of_corners.values[position]:g}"

    # Whole numbers in range.
    with np.errstate(invalid="ignore"):
        indices = lists_of_corners.values.astype(np.int64)
    if (broken := indices != lists_of_corners.values).any():
        raise InputError(f"{row(int(np.argmax(broken)))}, no whole number; export the mesh again")
    check_range(
        indices - least,
        size - least,
        lambda position: InputError(f"{row(position)}, there are {size} vertices; export the mesh again"),
    )
    return indices, lists_of_corners.counts


def _with_materials(file: _File, raw: RawMesh) -> RawMesh:
    """The mesh with a material for each image that the header names."""
    path, materials = file.path, {}
    if file.head.textures and raw.uvs is None:
        note(file.repairs, "textures without coordinates left out", f":{file.head.textures[0][1]}")
        return raw
    for name, line in file.head.textures:
        image, fault = nearby(path, name, path.parent)
        if fault:
            note(file.repairs, f"textures {fault} {TAKEN if image else 'left out'}", f":{line}")
        diffuse = {} if image is None else {"diffuse": {"texture": str(image)}}
        materials[name] = {"model": "lambert", **diffuse}
    if not any("diffuse" in each for each in materials.values()):
        return raw
    names = list(materials)
    by_number = np.array([names.index(name) for name, _ in file.head.textures])
    count = len(raw.counts)
    number = file.tables.get("face", {}).get("texnumber", np.zeros(count))
    chosen = np.zeros(count, np.int64)
    if isinstance(number, np.ndarray):  # strips have the first image
        chosen[: len(number)] = np.where((number >= 0) & (number < len(by_number)), number, 0)
    return replace(raw, material_names=tuple(names), materials=materials, polygon_materials=by_number[chosen])


def _count_what_is_left_out(file: _File) -> None:
    """Count elements and properties that are not supported."""
    for element in file.head.elements:
        if element.count and element.name not in ("vertex", "face", "tristrips"):
            note(file.repairs, "rows of other elements left out", f":{element.line}", element.count)
        for each in element.properties if element.name == "face" else ():
            if each.name in ("red", "diffuse_red"):
                note(file.repairs, "colours of faces left out", f":{each.line}")


def _attributes(file: _File) -> dict[str, NDArray[Any]]:
    """The vertex properties other than positions, normals and uv, in their type and native byte order."""
    vertex = file.tables["vertex"]
    types = {each.name: each.type for each in file.element("vertex").properties}
    taken = {"x", "y", "z"}
    if _has(vertex, _NORMAL):
        taken |= set(_NORMAL)
    taken |= set(next((pair for pair in _UV if _has(vertex, pair)), ()))
    attributes = {}
    for names in _COLORS:
        if "color" not in attributes and _has(vertex, names):
            attributes["color"] = _color(_stacked(vertex, names), types[names[0]])
            taken |= set(names)
    for name, values in vertex.items():
        if isinstance(values, Lists):
            note(file.repairs, "lists of vertices left out", file.line("vertex", name))
        elif name not in taken:
            label = f"{name}_" if name in attributes else name  # a scalar `color` beside red, green, blue
            attributes[label] = _typed(file, name, values, types[name].newbyteorder("="))
    return attributes


def _typed(file: _File, name: str, values: NDArray[Any], kind: np.dtype[Any]) -> NDArray[Any]:
    """Values in the type that the header declares; floats in text keep double precision."""
    if values.dtype.kind != "f" or kind.kind == "f":
        return values.astype(values.dtype.newbyteorder("="))
    limits = np.iinfo(kind)
    within = np.clip(np.nan_to_num(np.rint(values)), limits.min, limits.max)
    if (other := within != values).any():
        first = file.place("vertex", int(np.argmax(other)))
        note(file.repairs, "values that do not fit their type, rounded", first, int(np.count_nonzero(other)))
    return within.astype(kind)


def _color(values: NDArray[np.float64], kind: np.dtype[Any]) -> NDArray[np.float32]:
    """(V, 3) linear colours. Integers are sRGB, of their type's full range, or of a byte's if none is larger;
    floats are linear, or sRGB if they are in 0..255."""
    if kind.kind == "f":
        code = unit_range(values)
        return (values if code is values else from_srgb(np.clip(code, 0, 1))).astype(np.float32)
    largest = 255 if values.max(initial=0) <= 255 else np.iinfo(kind).max
    return from_srgb(np.clip(values / largest, 0, 1)).astype(np.float32)


# --- writing ------------------------------------------------------------------------------------------

_ABOUT = "illum "  # begins the comment that holds `VertexData.about`
_LABELS = {"normal": ["nx", "ny", "nz"], "uv": ["s", "t"], "color": ["red", "green", "blue"]}


def write(
    path: Path,
    meshes: Sequence[OutputMesh],
    data: VertexData,
    source: Path | None = None,
    split: SplitVertices | None = None,
) -> None:
    """Write meshes with the columns of `data` as properties, (V,) float each; `about` becomes a comment.

    With a PLY `source`, its elements and properties are written, too, in its own encoding, and with a `split`
    of a file that `has_plain_faces`, its vertices are split; `data` has a row for each of them. Other meshes
    are written in binary, with normals, uv and colours if every vertex has its own.
    """
    from plyfile import PlyData, PlyElement

    comment = _ABOUT + json.dumps(data.sealed_about())
    if source is not None:
        old = read_copy(source)
        elements = list(old) if split is None else [_split(each, split) for each in old]
        elements = [
            _with_columns(each, data, data.columns) if each.name == "vertex" else each for each in elements
        ]
        comments = [each for each in old.comments if not each.startswith(_ABOUT)]
        file = PlyData(elements, old.text, old.byte_order, [*comments, comment], list(old.obj_info))
    else:
        columns = _joined(meshes) | dict(data.columns)
        table = np.empty(
            sum(len(mesh.vertices) for mesh in meshes), [(name, each.dtype) for name, each in columns.items()]
        )
        for name, each in columns.items():
            table[name] = each
        vertex = _with_columns(PlyElement.describe(table, "vertex"), data, {})
        file = PlyData([vertex, _faces(meshes)], False, "<", [comment])
    with AtomicFile(path) as part:
        file.write(str(part.path))
        seal(part.path)


def has_plain_faces(path: Path, corners: int) -> bool:
    """True if all polygons of a PLY, which have so many corners, are its faces in their order."""
    file = read_copy(path)
    if "face" not in file or "tristrips" in file:
        return False
    return sum(map(len, file["face"].data[_corners_of(file["face"])])) == corners


def _corners_of(element: Any) -> str:
    """The name of the list of a face's corners."""
    from plyfile import PlyListProperty

    lists = [each.name for each in element.properties if isinstance(each, PlyListProperty)]
    return next(name for name in (*_CORNERS, *lists) if name in lists and name != "texcoord")


def _split(element: Any, split: SplitVertices) -> Any:
    """An element with copies of vertices, or with the corners that are these copies."""
    from plyfile import PlyElement, PlyListProperty

    if element.name not in ("vertex", "face"):
        return element
    properties = list(element.properties)
    if element.name == "vertex":
        table = element.data[split.source]
    else:
        name, table = _corners_of(element), element.data.copy()
        ends = np.cumsum([len(row) for row in table[name]])
        table[name][:] = [*np.split(split.of_corner, ends[:-1]), None][:-1]  # not one array of equal rows
        properties = [
            PlyListProperty(name, each.len_dtype, "i4") if each.name == name else each for each in properties
        ]
    new = PlyElement(element.name, properties, len(table), list(element.comments))
    new.data = table
    return new


def read_about(path: Path) -> dict[str, Any]:
    """`VertexData.about` of a PLY that was written here.

    Raises
    ------
    StopIteration, ValueError
        The file was not written by `write`.
    """
    with path.open("rb") as file:
        header = file.read(1 << 16).partition(b"end_header")[0].decode("latin-1")
    start = f"comment {_ABOUT}"
    line = next(line for line in header.splitlines() if line.startswith(start))
    return dict(json.loads(line.removeprefix(start)))


def _with_columns(element: Any, data: VertexData, added: Mapping[str, NDArray[Any]]) -> Any:
    """The element with columns and the colour of `data` added; properties of the same name are replaced."""
    from plyfile import PlyElement, PlyProperty

    columns = dict(added) | _colors(element.data, data)
    if not columns:
        return element
    kept = [each for each in element.properties if each.name not in columns]
    kinds = [(each.name, element.data.dtype[each.name]) for each in kept]
    table = np.empty(len(element.data), [*kinds, *((name, each.dtype) for name, each in columns.items())])
    for each in kept:
        table[each.name] = element.data[each.name]
    for name, values in columns.items():
        table[name] = values
    properties = [PlyProperty(name, each.dtype.str[1:]) for name, each in columns.items()]
    new = PlyElement("vertex", [*kept, *properties], len(table), list(element.comments))
    new.data = table
    return new


def _colors(vertex: NDArray[Any], data: VertexData) -> dict[str, NDArray[Any]]:
    """The colours of vertices with the change of `data`, by property; bytes, or of the type that they have.

    A number packed into one channel is a share of the type's largest value, colours of integers are sRGB.
    """
    if data.color is None:
        return {}
    present = vertex.dtype.names or ()
    names = next((names for names in _COLORS if set(names) <= set(present)), _COLORS[0])
    w = data.columns["obscurance"]
    if data.color.is_packed:
        white = {name: np.full(len(w), 255, np.uint8) for name in names if name not in present}
        name = (*names, "alpha")[data.color.channels[0]]
        return white | {name: _shares(w, _kind(vertex[name]) if name in present else BYTE)}
    colors: Floats = np.ones((len(w), 3))
    kind = BYTE
    if set(names) <= set(present):
        given = np.stack([vertex[name] for name in names], axis=1)
        colors, kind = _color(given.astype(np.float64), given.dtype), _kind(given)
    colors = data.color.applied(colors, w)
    code = colors if kind.kind == "f" else to_srgb(np.clip(colors, 0, 1))
    return {name: _shares(column, kind) for name, column in zip(names, code.T, strict=True)}


def _kind(values: NDArray[Any]) -> np.dtype[Any]:
    """The type in which changed colours are written: that which they have, unless bytes hold them."""
    largest = values.max(initial=0)
    fits = 1 < largest <= 255 or (values.dtype.kind != "f" and largest <= 255)
    return BYTE if fits else values.dtype.newbyteorder("=")


def _shares(values: Floats, kind: np.dtype[Any]) -> NDArray[Any]:
    """Values in [0, 1] in a type; integers hold shares of its largest value."""
    return values.astype(kind) if kind.kind == "f" else np.rint(np.iinfo(kind).max * values).astype(kind)


def _joined(meshes: Sequence[OutputMesh]) -> dict[str, NDArray[Any]]:
    """The vertex columns that every mesh has, those of all meshes one after the other."""
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    kind = np.float32 if fits_single(vertices) else np.float64
    columns: dict[str, NDArray[Any]] = {name: vertices[:, k].astype(kind) for k, name in enumerate("xyz")}
    common = set.intersection(*(set(mesh.attributes) for mesh in meshes))
    for name in sorted(common, key=lambda name: (name not in STANDARD, name)):
        parts = [np.asarray(mesh.attributes[name]) for mesh in meshes]
        if len({part.shape[1:] for part in parts}) > 1:
            continue
        values = np.concatenate(parts)
        if name == "color":
            values = srgb_bytes(values)
        if values.dtype.kind == "f":
            values = values.astype(np.float32)
        for label, column in zip(_labels(name, values), np.atleast_2d(values.T), strict=True):
            columns[free_name(label, columns)] = column
    return columns


def _labels(name: str, values: NDArray[Any]) -> list[str]:
    if name in _LABELS:
        return _LABELS[name]
    return [name] if values.ndim == 1 else [f"{name}_{k}" for k in range(values.shape[1])]


def _faces(meshes: Sequence[OutputMesh]) -> Any:
    """The element of the polygons of all meshes, one list for each."""
    from plyfile import PlyElement

    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    rows = np.empty(sum(len(mesh.starts) - 1 for mesh in meshes), [("vertex_indices", object)])
    lists = []
    for mesh, offset in zip(meshes, first, strict=False):
        lists += np.split((mesh.corners + offset).astype(np.int32), mesh.starts[1:-1])
    rows["vertex_indices"][:] = [*lists, None][:-1]  # numpy would make one array of lists of one length
    longest = max(int(np.diff(mesh.starts).max(initial=0)) for mesh in meshes)
    count_type = "u4" if longest > 255 else "u1"
    return PlyElement.describe(
        rows, "face", len_types={"vertex_indices": count_type}, val_types={"vertex_indices": "i4"}
    )


def srgb_bytes(linear: NDArray[Any]) -> NDArray[np.uint8]:
    """Colours in the form of PLY files: sRGB bytes."""
    return np.rint(255 * to_srgb(np.clip(np.asarray(linear, np.float64), 0, 1))).astype(np.uint8)
