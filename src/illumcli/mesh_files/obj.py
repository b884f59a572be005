"""Wavefront OBJ: polygons with normals, uv, groups, materials and vertex colours.

This reader exists because no library keeps polygons and is fast: `trimesh` splits quadrilaterals into
triangles and checks no index (0 becomes the last vertex), `meshio` is slower still, `tinyobjloader` has no
wheel and does not build from its source package. Best of five, one core, seconds (Python 3.11, numpy 2.4)::

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

import numpy as np
from numpy.typing import NDArray

from illumcli.color import from_srgb, to_srgb
from illumcli.errors import InputError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.repairs import Repair, joined, note
from illumcli.mesh_files import mtl
from illumcli.mesh_files._color import unit_range
from illumcli.mesh_files._companions.obj import library_names
from illumcli.mesh_files._files import TAKEN, content, nearby
from illumcli.mesh_files._polygons import Ints, RawMesh, checked_mesh
from illumcli.mesh_files._text import Block, Text, keyword
from illumcli.mesh_files._words import decoded, without_comment
from illumcli.mesh_files.obj_write import read_about
from illumcli.records import Value

# statements that define no polygons and affect none
_STATE = (
    "mg lod bevel c_interp d_interp shadow_obj trace_obj ctech stech maplib usemap vp cstype deg step bmat "
    "parm trim hole scrv sp end con"
)
_LEFT_OUT = {
    "p": "points left out",
    "l": "lines left out",
    "curv": "curves left out",
    "curv2": "curves left out",
    "surf": "surfaces left out",
    "call": "other files and commands left out",
    "csh": "other files and commands left out",
}
NOWHERE = 2**62  # a reference that is out of range in any file
_UNKNOWN = "unknown statements left out"


def read(path: Path) -> Mesh:
    """The polygons of an OBJ file, and the materials of its libraries.

    Vertex colours (three or four more numbers after a position) are sRGB, in 0..1 or 0..255; those that illum
    baked are the attribute `obscurance`. `o` and `g` both begin a group. Display attributes are ignored.
    Lines, points, free-form geometry and unknown statements are left out and counted in `repairs`, as are all
    repairs. Only a file whose faces cannot be determined is refused.
    """
    # The lines by keyword.
    text = Text.of(path, content(path), comments=True, continued=True)
    words = text.keywords(3)
    lines = {word: np.flatnonzero(words == keyword(word)) for word in (b"v", b"vn", b"vt", b"f")}
    known = sum((words == keyword(word) for word in lines), np.zeros(len(words), bool))
    rest = _Statements.of(text, np.flatnonzero(~known))
    repairs = {**text.repairs, **rest.repairs}

    # Tables of vertices, uv and normals; references of the faces to their rows.
    positions = text.block(lines[b"v"], keyword=1)
    vertices, attributes = _vertices(positions, repairs)
    if "color" in attributes and holds_obscurance(path):
        attributes = {"obscurance": to_srgb(attributes["color"][:, 0]).astype(np.float32)}
    uvs = _uvs(text.block(lines[b"vt"], keyword=2))
    normals = _normals(text.block(lines[b"vn"], keyword=2))
    faces = text.block(lines[b"f"], keyword=1)
    references, counts = _references(faces)

    def rows(slot: int, of: bytes, size: int, name: str) -> Ints:
        return _resolved(faces, references[slot], counts, _Rows(lines[of], size, name), repairs)

    corners = rows(0, b"v", len(vertices), "vertices")
    unknown: NDArray[np.bool_] = np.any(np.isnan(vertices), axis=1)
    for vertex in corners[unknown[corners]][:1].tolist():
        positions.refuse_words(vertex, 3)
    corner_uvs = rows(1, b"vt", len(uvs), "texture coordinates") if 1 in references else None
    corner_normals = rows(2, b"vn", len(normals), "normals") if 2 in references else None

    # Materials, groups and smoothing groups of the faces.
    library = _libraries(path, text, rest.libraries)
    repairs |= joined([repairs, library.repairs, _undefined(text, rest.materials, library)])
    material_names, polygon_materials = _selected(rest.materials, lines[b"f"])
    group_names, polygon_groups = _selected(rest.groups, lines[b"f"])
    raw = RawMesh(
        vertices,
        corners,
        counts,
        normals=normals if 2 in references and len(normals) else None,
        corner_normals=corner_normals if len(normals) else None,
        uvs=uvs if 1 in references and len(uvs) else None,
        corner_uvs=corner_uvs if len(uvs) else None,
        material_names=material_names,
        polygon_materials=polygon_materials,
        group_names=group_names,
        polygon_groups=polygon_groups,
        polygon_smoothing=_smoothing(rest.smoothing, lines[b"f"]),
        attributes=attributes,
        materials=library.materials,
        substitutes=library.substitutes,
        material_repairs=library.looks,
        repairs=repairs,
    )
    return checked_mesh(path, raw, lambda part, n: f":{text.number(int(lines[_PARTS[part]][n]))}")


GREY = (None, "replace")
"""What `--color` may be for colours that are the value."""


def holds_obscurance(path: Path) -> bool:
    """True if the colours of the vertices are values that illum baked, alike in all channels."""
    try:
        return dict(read_about(path)["parameters"])["color"] in GREY
    except (StopIteration, LookupError, TypeError, ValueError):
        return False


_PARTS = {"vertex": b"v", "uv": b"vt", "normal": b"vn", "face": b"f"}


class _Statements(Value):
    """The statements other than vertices and faces: pairs (line, name), in order."""

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
        left_out: dict[str, list[int]] = {}
        for line in lines.tolist():
            word, *name = text.line(line).split(None, 1)
            word = word.lower()
            if word in names:
                names[word].append((line, name[0] if name else ""))
            elif word not in _STATE.split():
                left_out.setdefault(_LEFT_OUT.get(word, _UNKNOWN), []).append(line)
        for what, numbers in left_out.items():
            note(rest.repairs, what, f":{text.number(numbers[0])}", len(numbers))
        return rest


def _vertices(
    block: Block, repairs: dict[str, Repair]
) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float32]]]:
    """(V, 3) positions, NaN if a line has none; attributes `color`, (V, 3), linear, and `alpha`, (V,), if any
    vertex has them."""
    # Four or more numbers: a weight, or a colour with or without alpha.
    counts, values = block.counts, _table(block, 7)
    _note_lines(repairs, "numbers behind a vertex left out", (counts == 5) | (counts > 7), block)
    _note_lines(repairs, "weights of vertices left out", (counts == 4) & (values[:, 3] != 1), block)
    colored = (counts == 6) | (counts == 7)
    if not colored.any():
        return np.ascontiguousarray(values[:, :3]), {}

    # Colours in 0..1, white if missing, to linear.
    colors = unit_range(np.where(colored[:, None], values[:, 3:], np.nan))
    bare: NDArray[np.bool_] = np.any(np.isnan(colors[:, :3]), axis=1)
    _note_lines(repairs, "vertices without a colour, made white", bare, block)
    colors = np.where(np.isnan(colors), 1.0, colors)
    inside = np.clip(colors, 0, 1)
    beyond: NDArray[np.bool_] = np.any(colors != inside, axis=1)
    _note_lines(repairs, "vertex colours beyond their range, clipped", beyond, block)
    attributes = {"color": from_srgb(inside[:, :3]).astype(np.float32)}
    if (counts == 7).any():
        attributes["alpha"] = inside[:, 3].astype(np.float32)
    return np.ascontiguousarray(values[:, :3]), attributes


def _note_lines(repairs: dict[str, Repair], what: str, wrong: NDArray[np.bool_], block: Block) -> None:
    """Count the lines of a block that are `wrong`."""
    if wrong.any():
        line = block.text.number(int(block.lines[np.argmax(wrong)]))
        note(repairs, what, f":{line}", int(np.count_nonzero(wrong)))


def _uvs(block: Block) -> NDArray[np.float64]:
    """(U, 2); a missing v is 0, a third coordinate is ignored; NaN where a word is not a number."""
    values = _table(block, 2)
    values[block.counts == 1, 1] = 0
    return values


def _normals(block: Block) -> NDArray[np.float64]:
    """(K, 3), NaN where a number is missing."""
    return _table(block, 3)


def _table(block: Block, size: int) -> NDArray[np.float64]:
    """(B, `size`) the first numbers of each line; NaN where a number is missing or a word is not a number."""
    values, counts = block.floats(needed=0), block.counts
    width = int(counts[0]) if len(counts) else size
    if (counts == width).all() and width >= size:
        return np.ascontiguousarray(values.reshape(-1, width)[:, :size])
    table = np.full((len(counts), size), np.nan)
    if (counts == width).all():
        table[:, :width] = values.reshape(len(counts), width)
        return table
    column = np.arange(size)
    present = column < counts[:, None]
    table[present] = values[((np.cumsum(counts) - counts)[:, None] + column)[present]]
    return table


def _references(faces: Block) -> tuple[dict[int, Ints], Ints]:
    """The references of the corners of faces.

    Returns
    -------
    references : dict
        Slot (0 vertex, 1 uv, 2 normal) -> (C,) the numbers as written, 0 for none; only slots in use.
    counts : (P,)
        Corners of each face.
    """
    # Without slashes there are only vertices.
    counts = faces.counts
    slash = faces.data == ord("/")
    if not slash.any():
        return {0: faces.integers()}, counts
    numbers = Block(faces.text, faces.lines, np.where(slash, np.uint8(32), faces.data), faces.starts)
    values, starts = numbers.integers(), np.flatnonzero(numbers.heads)

    # Slot of each number: that of the number before it plus the slashes between, 0 at the start of a corner.
    first = faces.heads[starts]  # True for the first number of a corner
    slots = np.where(first, 0, 1 + slash[starts - 2].view(np.int8))
    passed = int(slots.sum())
    slots[1:] += np.where(first[1:], 0, slots[:-1])

    # Check that all words are corners.
    corner = np.cumsum(first) - 1
    corner_count = int(counts.sum())
    four = ~(first[1:-2] | first[2:-1] | first[3:])
    explained = passed + _trailing(faces.data, slash) == np.count_nonzero(slash)
    if four.any() or slots.max(initial=0) > 2 or np.count_nonzero(first) != corner_count or not explained:
        raise _bad_corner(faces)

    values[(values == 0) & (slots > 0)] = NOWHERE  # 0 is written, so it is out of range
    references = {}
    for slot in range(3):
        used = slots == slot
        if used.any():
            references[slot] = np.zeros(corner_count, np.int64)
            references[slot][corner[used]] = values[used]
    return references, counts


def _trailing(data: NDArray[np.uint8], slash: NDArray[np.bool_]) -> int:
    """Number of slashes at the end of words: v/ and v// have only a vertex, v/vt/ has no normal."""
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


def _place(faces: Block, corner: int) -> str:
    """``path:line`` of a corner."""
    return faces.place(int(np.searchsorted(np.cumsum(faces.counts), corner, side="right")))


class _Rows(Value):
    """A table that faces refer to: the lines that define its rows, their number, and its name."""

    lines: NDArray[np.intp]
    size: int
    name: str


def _resolved(faces: Block, references: Ints, counts: Ints, rows: _Rows, repairs: dict[str, Repair]) -> Ints:
    """(C,) rows from 0; negative references count backwards from the face, and 0 gives -1.

    References to vertices that do not exist are refused; others are dropped and counted.
    """
    # Absolute rows.
    below = references < 0
    index = references - 1
    if below.any():
        before = np.repeat(np.searchsorted(rows.lines, faces.lines), counts)
        index = np.where(below, before + references, index)

    # Out of range; 0 is allowed except for vertices.
    wrong = (index < 0) | (index >= rows.size)
    if rows.name != "vertices":
        wrong &= references != 0
    if not wrong.any():
        return index
    bad = int(np.argmax(wrong))
    if rows.name != "vertices":
        line = int(np.searchsorted(np.cumsum(counts), bad, side="right"))
        first = f":{faces.text.number(int(faces.lines[line]))}"
        note(repairs, f"references to {rows.name} that are not there dropped", first, int(wrong.sum()))
        return np.where(wrong, -1, index)
    if references[bad] == 0:
        raise InputError(f"{_place(faces, bad)}: index 0; count from 1, or from -1 backwards")
    raise InputError(
        f"{_place(faces, bad)}: index {references[bad]} is out of range, there are {rows.size} "
        f"{rows.name}; correct the index"
    )


def _selected(
    statements: list[tuple[int, str]], faces: NDArray[np.intp]
) -> tuple[tuple[str, ...], NDArray[np.int64] | None]:
    """The distinct names in order, and (P,) the number of the name at each face, -1 before the first."""
    if not statements:
        return (), None
    names = {name: i for i, name in enumerate(dict.fromkeys(name for _, name in statements))}
    lines = np.array([line for line, _ in statements])
    ids = np.array([-1, *(names[name] for _, name in statements)])
    return tuple(names), ids[np.searchsorted(lines, faces)]


def libraries(path: Path) -> list[Path]:
    """The material libraries of an OBJ that exist, in order."""
    names = [without_comment(decoded(name)).strip() for name in library_names(content(path))]
    files = [file for name in dict.fromkeys(names) for file, _ in _library_files(path, name)]
    return [file for file in dict.fromkeys(files) if file is not None]


def _undefined(text: Text, statements: list[tuple[int, str]], library: mtl.Library) -> dict[str, Repair]:
    """Repairs for materials that faces select and no library has, if the file has libraries."""
    missing = {name: line for line, name in reversed(statements) if name not in library.materials}
    if not library.materials or not missing:
        return {}
    first = f":{text.number(min(missing.values()))}"
    return {"materials that no library has": Repair(len(missing), first)}


def _smoothing(statements: list[tuple[int, str]], faces: NDArray[np.intp]) -> NDArray[np.int64] | None:
    """(P,) smoothing group of each face: 0 for off, -1 before the first statement, others from 1."""
    names, chosen = _selected(statements, faces)
    if chosen is None:
        return None
    groups = [0 if _is_off(name) else k for k, name in enumerate(names, start=1)]
    return np.array([*groups, -1])[chosen]


def _is_off(group: str) -> bool:
    return group.lower() in ("off", "null") or group.strip("0") == ""


def _libraries(path: Path, text: Text, statements: list[tuple[int, str]]) -> mtl.Library:
    """The materials of all libraries, the first of each name, and what was left out of them."""
    library = mtl.Library()
    for names, line in {names: line for line, names in reversed(statements)}.items():
        place = f":{text.number(line)}"
        for file, fault in _library_files(path, names):
            if fault:
                note(library.repairs, f"material libraries {fault} {TAKEN if file else 'left out'}", place)
            if file is None:
                continue
            part = mtl.read(file, path.parent)
            library.materials.update({**part.materials, **library.materials})
            library.substitutes.update({**part.substitutes, **library.substitutes})
            library.repairs.update(joined([library.repairs, part.repairs]))
            library.looks.update(joined([library.looks, part.looks]))
    return library


def _library_files(path: Path, names: str) -> list[tuple[Path | None, str]]:
    """The file of one name that contains blanks, or the files of several names, each with its fault."""
    one = nearby(path, names.strip("\"'"), path.parent)
    several = [nearby(path, name, path.parent) for name in names.split()]
    return several if one[0] is None and any(file for file, _ in several) else [one]
