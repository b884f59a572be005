"""STL, text and binary: triangles that share no vertices.

Vertices are not merged: vertex 3 t + i is corner i of triangle t. Normals of facets are ignored, since they
are those of the triangles, and so are names of solids. A file is refused only if its facets cannot be
determined; all other faults are repaired or left out, and counted.

References
----------
3D Systems (1988). Stereolithography interface specification. It forbids loops of more than three vertices;
they are read as polygons. Colours of facets (Materialise Magics, VisCAM) are left out.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.repairs import Repair, note
from illumcli.mesh_files._files import content
from illumcli.mesh_files._polygons import RawMesh, checked_mesh
from illumcli.mesh_files._text import Text, keyword

_HEADER = 84  # bytes before the first binary facet: 80 of any content, then the count
_FACET = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("other", "<u2")])
_COLORED = 1 << 15  # bit of the two bytes behind a facet that marks them as a colour

_NAMES = (b"solid", b"facet", b"outer", b"vertex", b"endloop", b"endfacet", b"endsolid", b"end")
_STATEMENT = re.compile(rb"[ \t](?=(?:facet|outer|vertex|endloop|endfacet|endsolid)\b)")
_SOLID = re.compile(rb"[ \t]*(?:end[ \t]*)?solid")


def read(path: Path) -> Mesh:
    """The triangles of an STL file.

    A file is binary if its size agrees with its count of facets, whatever it begins with. Other files are
    text if they contain `facet` or `solid` and no NUL.
    """
    data = content(path)
    announced = int.from_bytes(data[80:_HEADER], "little")
    if len(data) != _HEADER + announced * _FACET.itemsize and _is_text(data):
        return _text(path, data)
    return _binary(path, data, announced)


def _is_text(data: bytes) -> bool:
    return b"\0" not in data[:1024].rstrip(b"\0\x1a") and re.search(rb"facet|solid", data, re.I) is not None


def _binary(path: Path, data: bytes, announced: int) -> Mesh:
    repairs: dict[str, Repair] = {}
    if len(data) < _HEADER:
        raise InputError(f"{path}: is no STL file, it has {len(data)} bytes; export the mesh again")
    held, behind = divmod(len(data) - _HEADER, _FACET.itemsize)
    if announced > held:
        share = (len(data) - _HEADER) / _FACET.itemsize
        raise InputError(f"{path}: announces {announced} facets and holds {share:g}; export the mesh again")
    count = announced
    if not announced and held and not behind:
        note(repairs, "facets that are not announced", ": facet 1", held)
        count = held
    elif end := len(data) - _HEADER - announced * _FACET.itemsize:
        note(repairs, "bytes behind the last facet left out", f": byte {len(data) - end + 1}", end)
    facets = np.frombuffer(data, _FACET, count, _HEADER)
    colored = (facets["other"] & _COLORED) != 0
    if b"COLOR=" in data[:80]:
        colored = np.ones(count, np.bool_)
    if colored.any():
        first = f": facet {int(np.argmax(colored)) + 1}"
        note(repairs, "colours of facets left out", first, int(np.count_nonzero(colored)))
    vertices = facets["vertices"].reshape(-1, 3).astype(np.float64)
    corners = np.arange(3 * count)
    return checked_mesh(path, RawMesh(vertices, corners, np.full(count, 3), repairs=repairs))


def _text(path: Path, data: bytes) -> Mesh:
    text = Text.of(path, data.lower())
    if text.data.count(b"vertex") > np.count_nonzero(text.keywords(8) == keyword(b"vertex")):
        text = Text(path, text.raw, _statements_as_lines(text.data), text.repairs)
    repairs = dict(text.repairs)
    words = text.keywords(8)
    lines = {name: np.flatnonzero(words == keyword(name)) for name in _NAMES}
    _note_other_lines(text, lines, repairs)

    # A loop begins with `outer loop`, or with its facet if that line is missing.
    marked = np.sort(np.concatenate([lines[b"facet"], lines[b"outer"], lines[b"vertex"]]))
    is_facet, is_outer = (np.isin(marked, lines[name]) for name in (b"facet", b"outer"))
    begins = is_outer | (is_facet & ~np.append(is_outer[1:], False))
    starts = marked[begins]
    loop = np.cumsum(begins)[~is_facet & ~is_outer] - 1

    # Each vertex must follow the start of its loop, without an end between.
    ends = np.sort(np.concatenate([lines[name] for name in (b"endloop", b"endfacet", b"end")]))
    last_end = np.append(-1, ends)[np.searchsorted(ends, lines[b"vertex"])]
    outside = last_end > np.append(-1, starts)[loop + 1]
    if (outside | (loop < 0)).any():
        bad = int(lines[b"vertex"][np.argmax(outside | (loop < 0))])
        raise InputError(f"{text.place(bad)}: a vertex stands outside of any facet; export the mesh again")
    if len(marked) and marked[-1] > ends.max(initial=-1):
        raise InputError(f"{path}: ends within a facet; the file is cut off, export it again")
    _note_missing_ends(text, lines, starts, repairs)

    # The numbers of each vertex.
    block = text.block(lines[b"vertex"], keyword=len(b"vertex"))
    if (short := block.counts < 3).any():
        block.refuse_words(int(np.argmax(short)), 3)
    values = block.floats(needed=3)
    if (longer := block.counts > 3).any():
        first = f":{text.number(int(block.lines[np.argmax(longer)]))}"
        note(repairs, "numbers behind a vertex left out", first, int(np.count_nonzero(longer)))
    first_numbers = (np.cumsum(block.counts) - block.counts)[:, None] + np.arange(3)
    vertices = values[first_numbers].reshape(-1, 3)

    parts = {"vertex": block.lines, "face": starts}
    counts = np.bincount(loop, minlength=len(starts))
    raw = RawMesh(vertices, np.arange(len(vertices)), counts, repairs=repairs)
    return checked_mesh(path, raw, lambda part, n: f":{text.number(int(parts[part][n]))}")


def _statements_as_lines(data: bytes) -> bytes:
    """`data` with each statement in its own line; the name of a solid may contain any word."""
    return b"\n".join(
        line if _SOLID.match(line) and b"facet normal" not in line else _STATEMENT.sub(b"\n", line)
        for line in data.split(b"\n")
    )


def _note_other_lines(text: Text, lines: dict[bytes, NDArray[Any]], repairs: dict[str, Repair]) -> None:
    """Count the lines that are not part of a solid."""
    known = np.zeros(len(text.starts), np.bool_)
    for numbers in lines.values():
        known[numbers] = True
    if not known.all():
        first = f":{text.number(int(np.argmin(known)))}"
        note(repairs, "lines that are no part of a facet left out", first, int(np.count_nonzero(~known)))
    if len(in_two := lines[b"end"]):
        note(repairs, "ends written in two words", f":{text.number(int(in_two[0]))}", len(in_two))


def _note_missing_ends(
    text: Text, lines: dict[bytes, NDArray[Any]], starts: NDArray[Any], repairs: dict[str, Repair]
) -> None:
    """Count facets, loops and solids that do not end, and facets outside of a solid."""
    solids, in_two = lines[b"solid"], lines[b"end"]
    if not len(solids) and len(starts):
        note(repairs, "facets outside of a solid", f":{text.number(int(starts[0]))}", len(starts))
    last = text.line(int(in_two[-1])).split() if len(in_two) else []
    missing = len(solids) - len(lines[b"endsolid"]) - (last[1:2] == ["solid"])
    if missing > 0:
        note(repairs, "solids without an end", f":{text.number(int(solids[-1]))}", missing)
    for name, end, begun in (("loops", b"endloop", starts), ("facets", b"endfacet", lines[b"facet"])):
        missing = 0 if len(in_two) else len(begun) - len(lines[end])
        if missing > 0:
            # the first that is followed by another before the next end
            following = np.append(lines[end], len(text.starts))[np.searchsorted(lines[end], begun)]
            bad = int(np.argmax(following >= np.append(begun[1:], len(text.starts))))
            note(repairs, f"{name} without an end", f":{text.number(int(begun[bad]))}", missing)
