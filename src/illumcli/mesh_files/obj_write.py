"""Writes OBJ files with a colour for each vertex: the lines of another OBJ, or meshes.

A value w is the colour `w w w` after the position, in all digits of single precision. The last line is a
comment that tells what was baked.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.color import to_srgb
from illumcli.files.atomic import AtomicFile
from illumcli.files.seal import seal
from illumcli.geometry.mesh import Mesh
from illumcli.mesh_files._files import content
from illumcli.mesh_files._text import Text, keyword
from illumcli.mesh_files.output_mesh import VertexData
from illumcli.records import Record

_ABOUT = b"# illum "
LONGEST_ABOUT = 1 << 20  # [bytes]


class NamedMesh(Record):
    """A mesh to write, in its place, and its name."""

    name: str
    mesh: Mesh


def extend_obj(path: Path, source: Path, mesh: Mesh, data: VertexData) -> None:
    """Write the lines of an OBJ with a colour after each position; `mesh` is what was read from it."""
    text = Text.of(source, content(source), comments=True, continued=True)
    lines = np.flatnonzero(text.keywords(3) == keyword(b"v"))
    pieces: list[bytes] = []
    at = 0
    for line, color in zip(lines.tolist(), _colors([mesh], data), strict=True):
        # In `data`, comments are newlines and continued lines are joined; in `raw` they are as in the file.
        start = int(text.starts[line])
        end = text.data.index(b"\n", start)
        position = b" ".join(text.data[start:end].split()[:4])
        ending = (
            b"\r" if text.raw[end - 1 : end] == b"\r" else b" " if text.raw[end : end + 1] == b"#" else b""
        )
        pieces += [text.raw[at:start], position, b" ", color, ending]
        at = end
    pieces.append(text.raw[at:].rstrip(b"\0\x1a"))
    kept = b"".join(pieces).removesuffix(b"\n").split(b"\n")
    _write(path, (line for line in kept if not line.startswith(_ABOUT)), data)


def write_obj(path: Path, meshes: Sequence[NamedMesh], data: VertexData, library: str | None) -> None:
    """Write meshes with their normals, uv, groups, smoothing groups and materials.

    Parameters
    ----------
    library : str, optional
        Name of the material library.
    """
    colors = iter(_colors([each.mesh for each in meshes], data))
    _write(path, _lines(meshes, colors, library), data)


def read_about(path: Path) -> dict[str, Any]:
    """`VertexData.about` of an OBJ that was written here.

    Raises
    ------
    StopIteration, ValueError
        The file was not written by `write_obj` or `extend_obj`.
    """
    with path.open("rb") as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - LONGEST_ABOUT))
        lines = file.read().splitlines()
    return dict(json.loads(next(line for line in reversed(lines) if line.startswith(_ABOUT))[len(_ABOUT) :]))


def _write(path: Path, lines: Iterable[bytes], data: VertexData) -> None:
    with AtomicFile(path) as part:
        with part.path.open("wb") as file:
            for line in lines:
                file.write(line + b"\n")
            file.write(_ABOUT + json.dumps(data.sealed_about()).encode() + b"\n")
        seal(part.path)


def _colors(meshes: Sequence[Mesh], data: VertexData) -> list[bytes]:
    """The colour of each vertex as text: the value as it is, or the mesh's sRGB colour with the change."""
    w, change = data.columns["obscurance"].astype(np.float64), data.color
    if change is None:
        return [b"%.9g %.9g %.9g" % (each, each, each) for each in w.tolist()]
    count = 4 if 3 in change.channels or any("alpha" in mesh.attributes for mesh in meshes) else 3
    colors = np.ones((len(w), count))
    first = 0
    for mesh in meshes:
        rows = slice(first, first := first + len(mesh.vertices))
        if "color" in mesh.attributes:
            colors[rows, :3] = np.clip(mesh.attributes["color"], 0, 1)
        if "alpha" in mesh.attributes:
            colors[rows, 3] = mesh.attributes["alpha"]
    if change.multiplies:
        colors = change.applied(colors, w)
    colors[:, :3] = to_srgb(colors[:, :3])
    if not change.multiplies:  # values are plain numbers
        colors = change.applied(colors, w)
    form = b" ".join([b"%.9g"] * count)
    return [form % tuple(row) for row in colors.tolist()]


def _lines(meshes: Sequence[NamedMesh], colors: Iterator[bytes], library: str | None) -> Iterator[bytes]:
    if library is not None:
        yield f"mtllib {library}".encode()
    first = {"v": 1, "vt": 1, "vn": 1}
    for named in meshes:
        mesh = named.mesh
        yield f"o {named.name}".encode()
        tables = {"v": mesh.vertices, "vt": mesh.uvs, "vn": mesh.normals}
        for word, table in tables.items():
            if table is None:
                continue
            digits = 9 if np.array_equal(table, table.astype(np.float32)) else 17
            form = f"{word} " + " ".join([f"%.{digits}g"] * table.shape[1])
            for row in table.tolist():
                line = (form % tuple(row)).encode()
                yield line + b" " + next(colors) if word == "v" else line
        yield from _faces(mesh, first)
        for word, table in tables.items():
            first[word] += 0 if table is None else len(table)


def _faces(mesh: Mesh, first: Mapping[str, int]) -> Iterator[bytes]:
    """The faces, with a statement before each that begins a group, a material or a smoothing group."""
    words = _corner_words(mesh, first)
    states = {
        "g": _names(mesh.polygon_groups, mesh.group_names, mesh.polygon_count),
        "usemtl": _names(mesh.polygon_materials, mesh.material_names, mesh.polygon_count),
        "s": _smoothing(mesh),
    }
    used = {word: names for word, names in states.items() if any(names)}
    current: dict[str, str | None] = dict.fromkeys(used)
    starts = mesh.starts.tolist()
    for polygon in range(mesh.polygon_count):
        for word, of_polygons in used.items():
            name = of_polygons[polygon]
            if name is not None and name != current[word]:
                yield f"{word} {name}".encode()
                current[word] = name
        yield b"f " + b" ".join(words[starts[polygon] : starts[polygon + 1]])


def _corner_words(mesh: Mesh, first: Mapping[str, int]) -> list[bytes]:
    """Each corner as v, v/vt, v//vn or v/vt/vn."""

    def numbers(rows: NDArray[np.int32] | None, word: str) -> list[str]:
        if rows is None:
            return [""] * len(mesh.corners)
        return [str(row + first[word]) if row >= 0 else "" for row in rows.tolist()]

    if mesh.corner_uvs is None and mesh.corner_normals is None:
        return [b"%d" % each for each in (mesh.corners + np.int64(first["v"])).tolist()]
    corners = zip(
        numbers(mesh.corners, "v"),
        numbers(mesh.corner_uvs, "vt"),
        numbers(mesh.corner_normals, "vn"),
        strict=True,
    )
    return ["/".join(each).rstrip("/").encode() for each in corners]


def _names(ids: NDArray[np.int32] | None, names: Sequence[str], count: int) -> list[str | None]:
    """The name of each polygon, on one line; None for none."""
    if ids is None:
        return [None] * count
    plain = [" ".join(name.split()) for name in names]
    return [plain[each] if each >= 0 else None for each in ids.tolist()]


def _smoothing(mesh: Mesh) -> list[str | None]:
    """The smoothing group of each polygon; None if it is not given."""
    if mesh.polygon_smoothing is None:
        return [None] * mesh.polygon_count
    return [None if each < 0 else str(each) if each else "off" for each in mesh.polygon_smoothing.tolist()]
