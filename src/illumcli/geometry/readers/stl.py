"""STL, text and binary: loose triangles.

A file's three vertices per triangle stay as they are: nothing is merged, so vertex 3 t + i is corner i of
triangle t. The normals of the facets are left out, being those of the triangles; so are the names of
solids and the two bytes behind each binary facet, which have no agreed meaning.

References
----------
3D Systems (1988). Stereolithography interface specification.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.readers._files import content
from illumcli.geometry.readers._polygons import polygons
from illumcli.geometry.readers._text import Text, keyword

_HEADER = 84  # bytes before the first binary facet: 80 of any content, then the count
_FACET = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("other", "<u2")])

_FACET_LINES = (b"facet", b"outer", b"vertex", b"vertex", b"vertex", b"endloop", b"endfacet")


def read(path: Path) -> Mesh:
    """The triangles of an STL file.

    A file is binary if its size is what its count of facets says, whatever it begins with.
    """
    data = content(path)
    announced = int.from_bytes(data[80:_HEADER], "little")
    if len(data) != _HEADER + announced * _FACET.itemsize and _is_text(data):
        vertices = _text(path, data)
    else:
        vertices = _binary(path, data, announced)
    count = len(vertices) // 3
    return polygons(path, vertices, np.arange(3 * count), np.full(count, 3))


def _is_text(data: bytes) -> bool:
    start = data[:1024].lstrip().lower()
    return start.startswith(b"solid") and b"\0" not in start


def _binary(path: Path, data: bytes, announced: int) -> NDArray[np.float64]:
    if len(data) < _HEADER:
        raise InputError(f"{path}: is no STL file, it has {len(data)} bytes; export the mesh again")
    if len(data) != _HEADER + announced * _FACET.itemsize:
        held = (len(data) - _HEADER) / _FACET.itemsize
        raise InputError(f"{path}: announces {announced} facets and holds {held:g}; export the mesh again")
    facets = np.frombuffer(data, _FACET, announced, _HEADER)
    return facets["vertices"].reshape(-1, 3).astype(np.float64)


def _text(path: Path, data: bytes) -> NDArray[np.float64]:
    text = Text.of(path, data.lower())
    words = text.keywords(8)
    bounds = np.isin(words, [keyword(b"solid"), keyword(b"endsolid")])
    lines = np.flatnonzero(~bounds)
    expected = np.resize([keyword(word) for word in _FACET_LINES], len(lines)).astype(np.uint64)
    wrong = lines[words[lines] != expected]
    inside = np.flatnonzero(bounds)[np.cumsum(~bounds)[bounds] % len(_FACET_LINES) != 0]
    solids = words[bounds] == keyword(b"solid")
    if len(wrong) or len(inside):
        first = int(min([*wrong[:1], *inside[:1]]))
        raise InputError(
            f"{text.place(first)}: '{text.line(first):.40}' is not what follows in a facet; "
            "export the mesh again"
        )
    if not bounds[-1] or len(solids) % 2 or not (solids[::2] & ~solids[1::2]).all():
        raise InputError(f"{path}: ends within a solid; the file is cut off, export it again")
    corners = text.block(lines[words[lines] == keyword(b"vertex")], keyword=len(b"vertex"))
    values = corners.floats()
    if (corners.counts != 3).any():
        bad = int(np.argmax(corners.counts != 3))
        raise InputError(f"{corners.place(bad)}: has {corners.counts[bad]} numbers; write vertex x y z")
    return values.reshape(-1, 3)
