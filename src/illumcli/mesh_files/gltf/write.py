"""Writes new GLB files: meshes with values at their vertices."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.mesh_files.gltf.document import open_document
from illumcli.mesh_files.gltf.glb_writer import INDICES, VERTICES, GlbWriter, appended
from illumcli.mesh_files.gltf.pbr import Encoded, MaterialWriter
from illumcli.mesh_files.gltf.reindex import fitting
from illumcli.mesh_files.gltf.vertex_colors import write_colors
from illumcli.mesh_files.occlusion import NO_MAPS, OcclusionMaps
from illumcli.mesh_files.output_mesh import (
    STANDARD,
    TEXTURE_UV,
    OutputMesh,
    VertexData,
    fits_single,
    free_name,
)
from illumcli.mesh_files.pbr import PbrMaterial
from illumcli.records import Record


class Rows(Record):
    """A primitive to write: some triangles of a mesh, over the vertices that they use."""

    group: int  # -1 none
    material: int  # -1 none
    vertices: NDArray[np.int64]  # (N,) ascending rows of the mesh's vertices
    triangles: NDArray[np.int64]  # (K, 3) rows of `vertices`


def write_glb(
    path: Path,
    meshes: Sequence[OutputMesh],
    data: VertexData,
    encoded: Encoded,
    occlusion: OcclusionMaps = NO_MAPS,
) -> None:
    """Write a node per group of each mesh, a primitive per material, and `data` as float attributes `_NAME`.

    Occlusion textures become those of materials; objects with different ones have materials of their own.

    Polygons become triangles. If single precision is too coarse, vertices are relative to the mesh's centre,
    which becomes the node's translation. If `data` has a colour, it becomes `COLOR_0`; viewers multiply all
    light by it, not only ambient light.
    """
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "illum", "extras": {"illum": data.sealed_about()}},
        "scene": 0,
        "scenes": [{"nodes": []}],
        "nodes": [],
        "meshes": [],
    }
    writer = GlbWriter(document)
    materials = MaterialWriter(writer, encoded)
    first = 0
    for index, mesh in enumerate(meshes):
        number_of_group: dict[int, int] = {}
        offset = _offset(mesh.vertices)
        for part in _primitives(mesh):
            primitive = _primitive(writer, mesh, part, offset, with_color=data.color is None)
            _add_values(writer, primitive["attributes"], mesh, part.vertices, data, first)
            has_map = (index, part.material) in occlusion.maps
            if part.material >= 0 or has_map:
                uv_set = sum(name.startswith("TEXCOORD_") for name in primitive["attributes"]) - 1
                primitive["material"] = materials.number(
                    mesh.materials[part.material] if part.material >= 0 else PbrMaterial(mesh.name),
                    (occlusion.maps[index, part.material], uv_set) if has_map else None,
                )
            if part.group not in number_of_group:
                name = _name(mesh, part.group, alone=len(meshes) == 1)
                number = appended(document["meshes"], {"name": name, "primitives": []})
                number_of_group[part.group] = number
                place = {} if offset is None else {"translation": offset.tolist()}
                node = appended(document["nodes"], {"name": name, "mesh": number, **place})
                document["scenes"][0]["nodes"].append(node)
            document["meshes"][number_of_group[part.group]]["primitives"].append(primitive)
        first += len(mesh.vertices)
    writer.write(path)


def _primitives(mesh: OutputMesh) -> Iterator[Rows]:
    """The triangles of each group and material, by group, then by material."""
    count = len(mesh.triangles)
    none = np.full(count, -1)
    groups = none if mesh.triangle_groups is None else mesh.triangle_groups.astype(np.int64)
    materials = none if mesh.triangle_materials is None else mesh.triangle_materials.astype(np.int64)
    key = (groups + 1) * (len(mesh.materials) + 1) + materials + 1
    order = np.argsort(key, kind="stable")
    starts = np.flatnonzero(np.diff(key[order], prepend=-1))
    for rows in np.split(order, starts[1:]):
        vertices, triangles = _numbered(mesh.triangles[rows], len(mesh.vertices))
        yield Rows(int(groups[rows[0]]), int(materials[rows[0]]), vertices, triangles.reshape(-1, 3))


def _numbered(triangles: NDArray[np.int32], count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The vertices of triangles, ascending, and the triangles over these; `count` vertices in all."""
    if 3 * len(triangles) < count:
        vertices, numbers = np.unique(triangles, return_inverse=True)
        return vertices.astype(np.int64), numbers
    is_used = np.zeros(count, np.bool_)  # without sorting
    is_used[triangles] = True
    return np.flatnonzero(is_used), (np.cumsum(is_used) - 1)[triangles]


def _offset(vertices: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """The centre of the vertices if single precision would move them, otherwise None."""
    return None if fits_single(vertices) else (vertices.min(axis=0) + vertices.max(axis=0)) / 2


def _name(mesh: OutputMesh, group: int, alone: bool) -> str:
    """The name of the node of a group: that of the group, after the mesh's if there are several meshes."""
    if group < 0:
        return mesh.name
    return mesh.group_names[group] if alone else f"{mesh.name}.{mesh.group_names[group]}"


def _primitive(
    writer: GlbWriter, mesh: OutputMesh, part: Rows, offset: NDArray[np.float64] | None, with_color: bool
) -> dict[str, Any]:
    """Positions, attributes that glTF can hold (up to four numbers per vertex), and indices; `with_color`
    those of vertices as they are."""
    vertices = mesh.vertices[part.vertices] - (0 if offset is None else offset)
    attributes = {"POSITION": positions(writer, vertices)}
    for name, given in sorted(mesh.attributes.items(), key=lambda each: each[0] not in STANDARD):
        values = np.asarray(given)[part.vertices]
        if (name == "alpha" and "color" in mesh.attributes) or not fits_attribute(values):
            continue
        if name == "color" and not with_color:
            continue
        if name == "color":
            label = "COLOR_0"
            if "alpha" in mesh.attributes:
                values = np.column_stack([values, _opacity(mesh)[part.vertices]])
        elif name == "normal":
            label, values = "NORMAL", unit_rows(values)
        elif name == "uv":
            label, values = "TEXCOORD_0", values * [1, -1] + [0, 1]  # glTF counts v downwards
        elif name == TEXTURE_UV:
            label = "TEXCOORD_1" if "uv" in mesh.attributes else "TEXCOORD_0"
            values = values * [1, -1] + [0, 1]
        else:
            label = name if name.startswith("_") else "_" + name.upper()
        attributes[free_name(label, attributes)] = writer.table(values.astype(np.float32), VERTICES)
    indices = writer.table(fitting(part.triangles.ravel(), len(vertices)), INDICES)
    return {"attributes": attributes, "indices": indices}


def _opacity(mesh: OutputMesh) -> NDArray[np.float64]:
    """(V,) the alpha of vertices in [0, 1]; the numbers of a PLY are those of its property, up to 255."""
    alpha = np.asarray(mesh.attributes["alpha"], np.float64)
    return np.clip(alpha / 255 if alpha.max(initial=0) > 1 else alpha, 0, 1)


def fits_attribute(values: NDArray[Any]) -> bool:
    """True if glTF can hold values as a vertex attribute: up to four numbers."""
    return values.ndim == 1 or values.shape[1] in (2, 3, 4)


def _add_values(
    writer: GlbWriter,
    attributes: dict[str, int],
    mesh: OutputMesh,
    vertices: NDArray[np.int64],
    data: VertexData,
    first: int,
) -> None:
    """Add the columns of `data` and its colour; `first` is the row of the mesh's first vertex."""
    rows = first + vertices
    for name, column in data.columns.items():
        attributes[f"_{name.upper()}"] = writer.table(column[rows].astype(np.float32), VERTICES)
    if data.color is not None:
        colors = np.ones((len(vertices), 4))
        kind: np.dtype[Any] = np.dtype(np.float32 if "color" in mesh.attributes else np.uint8)
        if "color" in mesh.attributes:
            colors[:, :3] = mesh.attributes["color"][vertices]
        if "alpha" in mesh.attributes:
            colors[:, 3] = _opacity(mesh)[vertices]
        write_colors(writer, attributes, data.color.applied(colors, data.columns["obscurance"][rows]), kind)


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
