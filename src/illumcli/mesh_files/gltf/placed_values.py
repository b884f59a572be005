"""Values at the vertices and corners of a glTF scene, by the mesh and the node that they belong to."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.mesh_files.gltf.document import Document
from illumcli.mesh_files.gltf.primitives import Part, parts
from illumcli.mesh_files.output_mesh import TEXTURE_UV, VertexData
from illumcli.records import Record


class PrimitiveValues(Record):
    """Values at the V vertices, and perhaps the corners of the T triangles, of a primitive at one place."""

    number: int  # of the primitive in its mesh
    material: int  # index in the material names of the mesh that is read, -1 none
    triangles: NDArray[np.int64]  # (T, 3) vertices, in the order of the file
    columns: Mapping[str, NDArray[Any]]  # (V,) or (V, k) by attribute
    at_corners: Mapping[str, NDArray[Any]]  # (3 T,) or (3 T, k); none if no vertex has several values


MeshValues: TypeAlias = list[PrimitiveValues]
"""The values of the primitives of a mesh at one place."""
Place: TypeAlias = tuple[int, int]
"""Number of a node, -1 if the file has none, and number of an instance of its mesh."""


def placed_values(
    document: Document, data: VertexData, texture_uvs: NDArray[np.float64] | None
) -> dict[int, dict[Place, MeshValues]]:
    """Mesh -> place -> values; a node that is reached through several parents has the values of the first.

    `texture_uvs` of corners, v upwards, become the attribute `TEXTURE_UV`, v downwards.
    """
    # The columns by the attributes that they become.
    columns: dict[str, NDArray[Any]] = {f"_{name.upper()}": each for name, each in data.columns.items()}
    corner_columns: dict[str, NDArray[Any]] = {
        f"_{name.upper()}": each for name, each in data.corner_columns.items()
    }
    if texture_uvs is not None:
        corner_columns[TEXTURE_UV] = texture_uvs * [1, -1] + [0, 1]

    # The rows of each part and instance.
    meshes: dict[int, dict[Place, MeshValues]] = {}
    known: set[tuple[int, int]] = set()
    materials: dict[int | None, int] = {}
    vertex = corner = 0
    for part in parts(document):
        is_named = part.material is not None or "color" in part.attributes
        material = materials.setdefault(part.material, len(materials)) if is_named else -1
        size, corners = len(part.vertices) // part.copies, part.triangles.size // part.copies
        is_new = (part.node, part.primitive) not in known or part.node < 0
        known.add((part.node, part.primitive))
        triangles = in_file_order(part, 0, part.triangles[: corners // 3].ravel()).reshape(-1, 3)
        for instance in range(part.copies) if is_new else ():
            of_vertices = slice(vertex + instance * size, vertex + (instance + 1) * size)
            of_corners = slice(corner + instance * corners, corner + (instance + 1) * corners)
            values = PrimitiveValues(
                part.primitive,
                material,
                triangles,
                {name: each[of_vertices] for name, each in columns.items()},
                {
                    name: in_file_order(part, instance, each[of_corners])
                    for name, each in corner_columns.items()
                },
            )
            meshes.setdefault(part.mesh, {}).setdefault((part.node, instance), []).append(values)
        vertex += part.copies * size
        corner += part.copies * corners
    return meshes


def in_file_order(part: Part, instance: int, at_corners: NDArray[Any]) -> NDArray[Any]:
    """(3 T, ...) values of the corners of an instance in the order of corners in the file."""
    if not part.is_reversed[instance]:
        return at_corners
    by_triangle = at_corners.reshape(-1, 3, *at_corners.shape[1:])
    return by_triangle[:, ::-1].reshape(at_corners.shape)


def digest(values: MeshValues) -> bytes:
    """A hash of values, equal for equal ones."""
    out = hashlib.blake2b(digest_size=16)
    for primitive in values:
        out.update(repr(primitive.number).encode())
        for columns in (primitive.columns, primitive.at_corners):
            for column in columns.values():
                out.update(np.ascontiguousarray(column).data)
    return out.digest()
