"""Writes new GLB files: meshes with values at their vertices."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.mesh_files.gltf.document import open_document
from illumcli.mesh_files.gltf.glb_writer import INDICES, VERTICES, GlbWriter
from illumcli.mesh_files.gltf.reindex import fitting
from illumcli.mesh_files.output_mesh import STANDARD, OutputMesh, VertexData, fits_single, free_name


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
    writer = GlbWriter(document)
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
        attributes = {"POSITION": positions(writer, vertices)}

        # The mesh's attributes, then the values.
        _add_attributes(writer, attributes, mesh, with_color=data.color is None)
        for name, column in data.columns.items():
            attributes[f"_{name.upper()}"] = writer.table(column[rows].astype(np.float32), VERTICES)
        if data.color is not None:
            color = np.full((len(vertices), 4), 255, np.uint8)
            if "color" in mesh.attributes:
                color[:, :3] = np.rint(255 * np.clip(mesh.attributes["color"], 0, 1))
            color[:, data.channels] = data.color[rows, None]
            attributes["COLOR_0"] = writer.table(color, VERTICES, normalized=True)

        indices = writer.table(fitting(mesh.triangles.ravel(), len(vertices)), INDICES)
        document["nodes"].append(node)
        document["meshes"].append({"primitives": [{"attributes": attributes, "indices": indices}]})
    writer.write(path)


def _add_attributes(
    writer: GlbWriter, attributes: dict[str, int], mesh: OutputMesh, with_color: bool
) -> None:
    """Add accessors for the attributes of a mesh that glTF can hold: up to four numbers per vertex."""
    for name, given in sorted(mesh.attributes.items(), key=lambda each: each[0] not in STANDARD):
        values = np.asarray(given)
        if name == "color":
            if with_color:
                attributes["COLOR_0"] = writer.table(values.astype(np.float32), VERTICES)
            continue
        if values.ndim > 1 and values.shape[1] not in (2, 3, 4):
            continue
        if name == "normal":
            label, values = "NORMAL", unit_rows(values)
        elif name == "uv":
            label, values = "TEXCOORD_0", values * [1, -1] + [0, 1]  # glTF counts v downwards
        else:
            label = name if name.startswith("_") else "_" + name.upper()
        attributes[free_name(label, attributes)] = writer.table(values.astype(np.float32), VERTICES)


def read_about(path: Path) -> dict[str, Any]:
    """`VertexData.about` of a GLB that was written here.

    Raises
    ------
    InputError, KeyError, TypeError
        The file was not written by `write_glb` or `extend_glb`.
    """
    return dict(open_document(path).json["asset"]["extras"]["illum"])


def positions(writer: GlbWriter, vertices: NDArray[np.float64]) -> int:
    """Add an accessor of positions, with their bounds."""
    rows = vertices.astype(np.float32)
    return writer.table(rows, VERTICES, min=rows.min(axis=0).tolist(), max=rows.max(axis=0).tolist())


def unit_rows(values: NDArray[Any]) -> NDArray[np.float64]:
    """(V, 3) normalized, (0, 0, 1) for zero vectors: glTF requires unit normals."""
    size = np.linalg.norm(values, axis=1, keepdims=True)
    return np.where(size > 0, values / np.where(size > 0, size, 1), [0.0, 0.0, 1.0])
