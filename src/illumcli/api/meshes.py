"""Meshes that Python hands over as arrays, written to files for the scenes that name them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.schema.messages import suggestion

PARTS = ("vertices", "faces", "normals", "uv")
PROPERTIES = {"vertices": ("x", "y", "z"), "normals": ("nx", "ny", "nz"), "uv": ("u", "v")}


class MeshLike(Protocol):
    """A mesh of some other library."""

    @property
    def vertices(self) -> Any:
        """(V, 3) numbers."""

    @property
    def faces(self) -> Any:
        """(F, K) numbers of vertices, from 0."""


def is_mesh(value: Any) -> bool:
    """True for a mapping with arrays `vertices` and `faces`, or an object with both, such as trimesh's."""
    if isinstance(value, Mapping):
        return {"vertices", "faces"} <= set(value) and "shape" not in value
    return hasattr(value, "vertices") and hasattr(value, "faces") and not isinstance(value, type)


def write_mesh(value: Any, folder: Path) -> Path:
    """Write a mesh as a PLY of doubles, named by its content. Returns the file's path.

    Parameters
    ----------
    value : mapping or object
        `vertices`, (V, 3), and `faces`, (F, K) vertex numbers from 0 or a list of lists of them; a mapping
        may have `normals`, (V, 3), and `uv`, (V, 2). Of an object such as trimesh's, places and faces alone.

    Raises
    ------
    InputError
        Arrays of other shapes, other keys, or numbers of vertices that there are not.
    """
    parts = value if isinstance(value, Mapping) else {"vertices": value.vertices, "faces": value.faces}
    if unknown := [str(name) for name in parts if name not in PARTS]:
        raise InputError(f"mesh: unknown key '{unknown[0]}'; {suggestion(unknown[0], PARTS)}")
    columns = {name: _array(name, parts[name], len(PROPERTIES[name])) for name in PROPERTIES if name in parts}
    count = len(columns["vertices"])
    for name, array in columns.items():
        if len(array) != count:
            raise InputError(f"mesh: {count} vertices and {len(array)} {name}; give one per vertex")
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {count}"]
    header += [f"property double {name}" for part in columns for name in PROPERTIES[part]]
    faces, number = _faces(parts["faces"], count)
    header += [f"element face {number}", "property list int int vertex_indices", "end_header\n"]
    body = np.concatenate(list(columns.values()), axis=1).astype("<f8").tobytes() + faces
    data = "\n".join(header).encode() + body
    path = folder / f"mesh-{hashlib.blake2b(data, digest_size=8).hexdigest()}.ply"
    path.write_bytes(data)
    return path


def _array(name: str, values: Any, width: int) -> NDArray[np.float64]:
    try:
        array = np.asarray(values)
    except ValueError:
        raise InputError(
            f"mesh: {name} must be an array of N x {width} numbers, has rows of several lengths"
        ) from None
    if array.ndim != 2 or array.shape[1] != width or array.dtype.kind not in "iuf":
        raise InputError(
            f"mesh: {name} must be an array of N x {width} numbers, is {array.dtype} of shape {array.shape}"
        )
    return array.astype(np.float64)


def _faces(faces: Any, vertices: int) -> tuple[bytes, int]:
    """The list property of a PLY: for each face its number of corners and the corners."""
    rows = [faces] if isinstance(faces, np.ndarray) and faces.ndim == 2 else [np.atleast_2d(f) for f in faces]
    corners = np.concatenate([np.asarray(each).ravel() for each in rows]) if len(rows) else np.zeros(0)
    if corners.dtype.kind not in "iu":
        raise InputError(f"mesh: faces must be vertex numbers, are {corners.dtype}")
    if len(corners) and not (corners.min() >= 0 and corners.max() < vertices):
        named = f"{corners.min()} to {corners.max()}"
        raise InputError(f"mesh: faces name vertices {named}, there are 0 to {vertices - 1}")
    lists = [
        np.insert(np.asarray(each), 0, np.shape(each)[1], axis=1).astype("<i4").tobytes() for each in rows
    ]
    return b"".join(lists), sum(len(each) for each in rows)
