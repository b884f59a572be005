"""Writes GLB files: meshes with values at their vertices, or such values added to an existing file."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.files.atomic import AtomicFile
from illumcli.files.seal import seal
from illumcli.mesh_files.gltf.document import open_document
from illumcli.mesh_files.output_mesh import STANDARD, OutputMesh, VertexData, fits_single, free_name

_FLOAT, _UBYTE, _UINT = 5126, 5121, 5125  # component types
_VERTICES, _INDICES = 34962, 34963  # targets of a buffer view
_JSON, _BIN = 0x4E4F534A, 0x004E4942


def write_glb(path: Path, meshes: Sequence[OutputMesh], data: VertexData) -> None:
    """Write a node per mesh with its vertices in their order, and `data` as float attributes `_NAME`.

    Polygons become triangles. If single precision is too coarse, vertices are relative to the mesh's centre,
    which becomes the node's translation. If `data` has a colour, it becomes `COLOR_0`; viewers multiply all
    light by it, not only ambient light.
    """
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "illum", "extras": {"illum": data.sealed_about()}},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(meshes)))}],
        "nodes": [],
        "meshes": [],
    }
    buffer = _Buffer(document)
    first = 0
    for number, mesh in enumerate(meshes):
        rows = slice(first, first + len(mesh.vertices))
        first = rows.stop

        # Positions, relative to the centre if single precision would move them.
        node = {"mesh": number, "name": mesh.name}
        vertices = mesh.vertices
        if not fits_single(vertices):
            centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
            node["translation"] = centre.tolist()
            vertices = vertices - centre
        attributes = {"POSITION": buffer.add(vertices.astype("<f4"), _VERTICES, bounds=True)}

        # The mesh's attributes, then the values.
        _add_attributes(buffer, attributes, mesh, with_color=data.color is None)
        for name, column in data.columns.items():
            attributes[f"_{name.upper()}"] = buffer.add(column[rows].astype("<f4"), _VERTICES)
        if data.color is not None:
            color = np.full((len(vertices), 4), 255, np.uint8)
            if "color" in mesh.attributes:
                color[:, :3] = np.rint(255 * np.clip(mesh.attributes["color"], 0, 1))
            color[:, data.channels] = data.color[rows, None]
            attributes["COLOR_0"] = buffer.add(color, _VERTICES)

        indices = buffer.add(mesh.triangles.astype("<u4").ravel(), _INDICES)
        document["nodes"].append(node)
        document["meshes"].append({"primitives": [{"attributes": attributes, "indices": indices}]})
    buffer.write(path)


def _add_attributes(buffer: _Buffer, attributes: dict[str, int], mesh: OutputMesh, with_color: bool) -> None:
    """Add accessors for the attributes of a mesh that glTF can hold: up to four numbers per vertex."""
    for name, given in sorted(mesh.attributes.items(), key=lambda each: each[0] not in STANDARD):
        values = np.asarray(given)
        if name == "color":
            if with_color:
                attributes["COLOR_0"] = buffer.add(values.astype("<f4"), _VERTICES)
            continue
        if values.ndim > 1 and values.shape[1] not in (2, 3, 4):
            continue
        if name == "normal":
            label, values = "NORMAL", unit_rows(values)
        elif name == "uv":
            label, values = "TEXCOORD_0", values * [1, -1] + [0, 1]  # glTF counts v downwards
        else:
            label = name if name.startswith("_") else "_" + name.upper()
        attributes[free_name(label, attributes)] = buffer.add(values.astype("<f4"), _VERTICES)


def add_to_glb(
    path: Path, source: tuple[dict[str, Any], bytes], counts: Sequence[tuple[int, int, int]], data: VertexData
) -> None:
    """Write a GLB again with `data` added to each primitive as attributes `_NAME`, and nothing else changed.

    Parameters
    ----------
    source : (dict, bytes)
        The JSON of the input, which is modified, and its binary chunk.
    counts : sequence of (mesh, primitive, vertices)
        The primitives in the order of the rows of `data`, each once.
    """
    document, binary = source
    buffer = _Buffer(document, binary)
    extras = document["asset"].get("extras")
    about = {"illum": data.sealed_about()}
    document["asset"]["extras"] = {**extras, **about} if isinstance(extras, dict) else about
    first = 0
    for mesh, primitive, count in counts:
        attributes = document["meshes"][mesh]["primitives"][primitive]["attributes"]
        for name, column in data.columns.items():
            rows = column[first : first + count]
            attributes[f"_{name.upper()}"] = buffer.add(rows.astype("<f4"), _VERTICES)
        first += count
    buffer.write(path)


def read_about(path: Path) -> dict[str, Any]:
    """`VertexData.about` of a GLB that was written here.

    Raises
    ------
    InputError, KeyError, TypeError
        The file was not written by `write_glb` or `add_to_glb`.
    """
    return dict(open_document(path).json["asset"]["extras"]["illum"])


def unit_rows(values: NDArray[Any]) -> NDArray[np.float64]:
    """(V, 3) normalized, (0, 0, 1) for zero vectors: glTF requires unit normals."""
    size = np.linalg.norm(values, axis=1, keepdims=True)
    return np.where(size > 0, values / np.where(size > 0, size, 1), [0.0, 0.0, 1.0])


class _Buffer:
    """The binary chunk of a GLB while it is written, with its views and accessors."""

    def __init__(self, document: dict[str, Any], data: bytes = b"") -> None:
        self.document, self.parts, self.size = document, [data], len(data)

    def add(self, values: NDArray[Any], target: int, bounds: bool = False) -> int:
        """Append an array, (N,) or (N, k); returns the number of its accessor."""
        raw = np.ascontiguousarray(values)
        fill = -self.size % 4
        view = {"buffer": 0, "byteOffset": self.size + fill, "byteLength": raw.nbytes, "target": target}
        self.parts += [b"\0" * fill, raw.tobytes()]
        self.size += fill + raw.nbytes
        views = self.document.setdefault("bufferViews", [])
        accessors = self.document.setdefault("accessors", [])
        kind = {"f4": _FLOAT, "u1": _UBYTE, "u4": _UINT}[raw.dtype.str[1:]]
        width = "SCALAR" if raw.ndim == 1 else f"VEC{raw.shape[1]}"
        accessor = {"bufferView": len(views), "componentType": kind, "count": len(raw), "type": width}
        if raw.dtype == np.uint8:
            accessor["normalized"] = True
        if bounds:
            accessor |= {"min": raw.min(axis=0).tolist(), "max": raw.max(axis=0).tolist()}
        views.append(view)
        accessors.append(accessor)
        return len(accessors) - 1

    def write(self, path: Path) -> None:
        """Write the GLB, whole or not at all."""
        data = b"".join(self.parts)
        data += b"\0" * (-len(data) % 4)
        self.document["buffers"] = [{"byteLength": len(data)}, *self.document.get("buffers", [])[1:]]
        text = json.dumps(self.document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        with AtomicFile(path) as part:
            with part.path.open("wb") as file:
                file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data)))
                file.write(struct.pack("<II", len(text), _JSON) + text)
                file.write(struct.pack("<II", len(data), _BIN) + data)
            seal(part.path)
