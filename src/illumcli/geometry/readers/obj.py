"""Wavefront OBJ: polygons with normals, uv, groups, materials and vertex colours.

A reader of our own because no library keeps polygons at speed: `trimesh` cuts quadrangles in triangles and
checks no index (0 becomes the last vertex), `meshio` is slower still, `tinyobjloader` has no wheel and does
not build from its source package. Best of five, one core, seconds (Python 3.11, numpy 2.4)::

                                        here    trimesh 5.2    meshio 5.3
    Stanford bunny, 69,451 faces        0.046   0.15           0.30
    1,000,000 triangles, 37 MB          0.72    2.3            4.4

References
----------
Wavefront Technologies (1992). Advanced Visualizer manual, appendix B1: object files.
"""

from __future__ import annotations

import re
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.readers import _mtl
from illumcli.geometry.readers._color import linear
from illumcli.geometry.readers._files import TAKEN, content, nearby
from illumcli.geometry.readers._polygons import Ints, polygons
from illumcli.geometry.readers._text import Block, Text, keyword
from illumcli.geometry.repairs import Repair, joined, note
from illumcli.records import Value

# statements that hold no polygons and change none; free-form geometry is counted in `repairs`
_STATE = (
    "mg lod bevel c_interp d_interp shadow_obj trace_obj ctech stech maplib usemap vp cstype deg step bmat "
    "parm trim hole scrv sp end con call csh"
)
_OTHER_SHAPES = {"p": "points", "l": "lines", "curv": "curves", "curv2": "curves", "surf": "surfaces"}


def read(path: Path) -> Mesh:
    """The polygons of an OBJ file, and the materials of its libraries.

    Vertex colours (three more numbers behind a position) are taken for sRGB, in 0..1 or 0..255. `o` and `g`
    both begin a group. Display attributes are left out; lines, points and free-form geometry are counted in
    `repairs`.
    """
    text = Text.of(path, content(path), comments=True, continued=True)
    words = text.keywords(3)
    lines = {word: np.flatnonzero(words == keyword(word)) for word in (b"v", b"vn", b"vt", b"f")}
    known = sum((words == keyword(word) for word in lines), np.zeros(len(words), bool))
    rest = _Statements.of(text, np.flatnonzero(~known))
    repairs = dict(rest.repairs)
    vertices, color = _vertices(text.block(lines[b"v"], keyword=1), repairs)
    uvs = _uvs(text.block(lines[b"vt"], keyword=2))
    normals = _normals(text.block(lines[b"vn"], keyword=2))
    faces = text.block(lines[b"f"], keyword=1)
    references, counts = _references(faces)

    def rows(slot: int, of: bytes, size: int) -> Ints:
        return _resolved(faces, references[slot], counts, _Rows(lines[of], size, _NAMES[of]))

    corners = rows(0, b"v", len(vertices))
    library = _libraries(path, text, rest.libraries)
    repairs = dict(joined([repairs, library.repairs]))
    material_names, polygon_materials = _selected(rest.materials, lines[b"f"])
    group_names, polygon_groups = _selected(rest.groups, lines[b"f"])
    return polygons(
        path,
        vertices,
        corners,
        counts,
        normals=normals if 2 in references else None,
        corner_normals=rows(2, b"vn", len(normals)) if 2 in references else None,
        uvs=uvs if 1 in references else None,
        corner_uvs=rows(1, b"vt", len(uvs)) if 1 in references else None,
        material_names=material_names,
        polygon_materials=polygon_materials,
        group_names=group_names,
        polygon_groups=polygon_groups,
        polygon_smoothing=_smoothing(rest.smoothing, lines[b"f"]),
        attributes={} if color is None else {"color": color},
        materials=library.materials,
        substitutes=library.substitutes,
        repairs=repairs,
        place=lambda part, n: f":{text.number(int(lines[_PARTS[part]][n]))}",
    )


_NAMES = {b"v": "vertices", b"vt": "texture coordinates", b"vn": "normals"}


_PARTS = {"vertex": b"v", "uv": b"vt", "normal": b"vn", "face": b"f"}


class _Statements(Value):
    """What the lines say that are neither vertices nor faces: (line, name) each, in order."""

    materials: list[tuple[int, str]] = field(default_factory=list)
    groups: list[tuple[int, str]] = field(default_factory=list)
    smoothing: list[tuple[int, str]] = field(default_factory=list)
    libraries: list[tuple[int, str]] = field(default_factory=list)
    repairs: dict[str, Repair] = field(default_factory=dict)

    @classmethod
    def of(cls, text: Text, lines: NDArray[np.intp]) -> _Statements:
        rest = cls()
        names = {
            "usemtl": rest.materials,
            "o": rest.groups,
            "g": rest.groups,
            "s": rest.smoothing,
            "mtllib": rest.libraries,
        }
        for line in lines.tolist():
            word, _, name = text.line(line).replace("\t", " ").partition(" ")
            if word in names:
                names[word].append((line, name.strip()))
            elif word in _OTHER_SHAPES:
                note(rest.repairs, f"{_OTHER_SHAPES[word]} left out", f":{text.number(line)}")
            elif word not in _STATE.split():
                raise InputError(
                    f"{text.place(line)}: '{word:.40}' is no statement of an OBJ file; remove the line or "
                    "give the file the suffix of its format"
                )
        return rest


def _vertices(block: Block, repairs: dict[str, Repair]) -> tuple[NDArray[Any], NDArray[np.float32] | None]:
    """(V, 3) positions, and (V, 3) linear colours where any vertex has one; the others are white then."""
    values = _table(block, (3, 4, 6), 6, fill=np.nan, what="v x y z, or v x y z r g b")
    vertices = np.ascontiguousarray(values[:, :3])
    colored = block.counts == 6
    if not colored.any():
        return vertices, None
    code = values[colored, 3:]
    if not ((code >= 0) & (code <= 255)).all():
        bad = np.flatnonzero(colored)[np.argmin(((code >= 0) & (code <= 255)).all(axis=1))]
        raise InputError(
            f"{block.place(int(bad))}: a vertex colour must be in 0..1, or in 0..255; correct it"
        )
    if code.max() > 1:
        code = code / 255
    if not colored.all():
        first = f":{block.text.number(int(block.lines[np.argmin(colored)]))}"
        count = int(np.count_nonzero(~colored))
        note(repairs, "vertices without a colour, made white", first, count)
    color = np.ones((len(vertices), 3), np.float32)
    color[colored] = linear(code)
    return vertices, color


def _uvs(block: Block) -> NDArray[np.float64]:
    """(U, 2); a missing v is 0, a third coordinate is left out."""
    values = _table(block, (1, 2, 3), 2, fill=0.0, what="vt u v")
    return np.ascontiguousarray(values)


def _normals(block: Block) -> NDArray[np.float64]:
    return _table(block, (3,), 3, fill=0.0, what="vn x y z")


def _table(
    block: Block, widths: tuple[int, ...], size: int, *, fill: float, what: str
) -> NDArray[np.float64]:
    """(B, `size`) the first numbers of each line of one of the `widths`, `fill` where it has fewer."""
    values, counts = block.floats(), block.counts
    right = np.isin(counts, widths)
    if not right.all():
        bad = int(np.argmin(right))
        raise InputError(f"{block.place(bad)}: has {counts[bad]} numbers; write {what}")
    if not len(counts) or (counts == counts[0]).all():
        width = int(counts[0]) if len(counts) else size
        table = values.reshape(-1, width)[:, :size]
        if table.shape[1] == size:
            return table
        return np.pad(table, ((0, 0), (0, size - table.shape[1])), constant_values=fill)
    column = np.arange(size)
    first = np.cumsum(counts) - counts
    present = column < counts[:, None]
    index = np.where(present, first[:, None] + column, 0)
    return np.where(present, values[index], fill)


def _references(faces: Block) -> tuple[dict[int, Ints], Ints]:
    """Per slot (0 vertex, 1 uv, 2 normal) that any face uses, (C,) the number written, 0 for none.

    Second, (P,) corners of each face.
    """
    counts = faces.counts
    slash = faces.data == ord("/")
    if not slash.any():
        return {0: _nonzero(faces, faces.integers(), np.arange(counts.sum()))}, counts
    numbers = Block(faces.text, faces.lines, np.where(slash, np.uint8(32), faces.data), faces.starts)
    values, starts = numbers.integers(), np.flatnonzero(numbers.heads)
    first = faces.heads[starts]  # of its corner
    slots = np.where(first, 0, 1 + slash[starts - 2].view(np.int8))
    passed = int(slots.sum())
    slots[1:] += np.where(first[1:], 0, slots[:-1])
    corner = np.cumsum(first) - 1
    corner_count = int(counts.sum())
    four = ~(first[1:-2] | first[2:-1] | first[3:])
    explained = passed + _trailing(faces.data, slash) == np.count_nonzero(slash)
    if four.any() or slots.max(initial=0) > 2 or np.count_nonzero(first) != corner_count or not explained:
        raise _bad_corner(faces)
    _nonzero(faces, values, corner)
    references = {}
    for slot in range(3):
        used = slots == slot
        if used.any():
            references[slot] = np.zeros(corner_count, np.int64)
            references[slot][corner[used]] = values[used]
    return references, counts


def _trailing(data: NDArray[np.uint8], slash: NDArray[np.bool_]) -> int:
    """Slashes that nothing follows: v/ and v// name a vertex alone, v/vt/ has no normal."""
    last = np.flatnonzero(slash[:-1] & (data[1:] <= 32))
    return len(last) + int(np.count_nonzero(slash[last - 1]))


_CORNER = re.compile(rb"[-+]?\d+(/([-+]?\d+)?(/([-+]?\d+)?)?)?")


def _bad_corner(faces: Block) -> InputError:
    words = faces.data.tobytes().split()
    bad = next((i for i, word in enumerate(words) if not _CORNER.fullmatch(word)), 0)
    word = words[bad].decode("utf-8", "replace")
    return InputError(
        f"{_place(faces, bad)}: '{word:.40}' is no corner of a face; write v, v/vt, v//vn or v/vt/vn"
    )


def _nonzero(faces: Block, values: Ints, corner: NDArray[np.intp]) -> Ints:
    if not values.all():
        bad = int(corner[np.argmin(values != 0)])
        raise InputError(f"{_place(faces, bad)}: index 0; count from 1, or from -1 backwards")
    return values


def _place(faces: Block, corner: int) -> str:
    """``path:line`` of a corner."""
    return faces.place(int(np.searchsorted(np.cumsum(faces.counts), corner, side="right")))


class _Rows(Value):
    """What a face refers to: the lines that define the rows, how many, and what they are called."""

    lines: NDArray[np.intp]
    size: int
    name: str


def _resolved(faces: Block, references: Ints, counts: Ints, rows: _Rows) -> Ints:
    """(C,) rows counted from 0; references below 0 count back from the face, 0 gives -1."""
    below = references < 0
    index = references - 1
    if below.any():
        before = np.repeat(np.searchsorted(rows.lines, faces.lines), counts)
        index = np.where(below, before + references, index)
    wrong = ((index < 0) | (index >= rows.size)) & (references != 0)
    if wrong.any():
        bad = int(np.argmax(wrong))
        raise InputError(
            f"{_place(faces, bad)}: index {references[bad]} is out of range, there are {rows.size} "
            f"{rows.name}; correct the index"
        )
    return index


def _selected(
    statements: list[tuple[int, str]], faces: NDArray[np.intp]
) -> tuple[tuple[str, ...], NDArray[np.int64] | None]:
    """The distinct names in order, and (P,) the one in force at each face, -1 before the first."""
    if not statements:
        return (), None
    names = {name: i for i, name in enumerate(dict.fromkeys(name for _, name in statements))}
    lines = np.array([line for line, _ in statements])
    ids = np.array([-1, *(names[name] for _, name in statements)])
    return tuple(names), ids[np.searchsorted(lines, faces)]


def _smoothing(statements: list[tuple[int, str]], faces: NDArray[np.intp]) -> NDArray[np.int64] | None:
    """(P,) smoothing group of each face: 0 off, -1 where none is said, the others numbered from 1."""
    names, chosen = _selected(statements, faces)
    if chosen is None:
        return None
    groups = [0 if _is_off(name) else k for k, name in enumerate(names, start=1)]
    return np.array([*groups, -1])[chosen]


def _is_off(group: str) -> bool:
    return group.lower() in ("off", "null") or group.strip("0") == ""


def _libraries(path: Path, text: Text, statements: list[tuple[int, str]]) -> _mtl.Library:
    """Every material of the libraries, the first of a name, and what was left out of them."""
    whole = _mtl.Library()
    for names, line in {names: line for line, names in reversed(statements)}.items():
        place = f":{text.number(line)}"
        for file, matter in _library_files(path, names):
            if matter:
                note(whole.repairs, f"material libraries {matter} {TAKEN if file else 'left out'}", place)
            if file is None:
                continue
            found = _mtl.read(file, path.parent)
            whole.materials.update({**found.materials, **whole.materials})
            whole.substitutes.update({**found.substitutes, **whole.substitutes})
            whole.repairs.update(joined([whole.repairs, found.repairs]))
    return whole


def _library_files(path: Path, names: str) -> list[tuple[Path | None, str]]:
    """The file of the one name with blanks, or those of several names, and what is the matter with each."""
    whole = nearby(path, names.strip("\"'"), path.parent)
    several = [nearby(path, name, path.parent) for name in names.split()]
    return several if whole[0] is None and any(file for file, _ in several) else [whole]
