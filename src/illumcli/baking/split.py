"""The objects of a bake as they are written: with the vertices of the mesh, or with vertices split where
their corners differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.scene_geometry import PlacedMesh, SceneGeometry
from illumcli.geometry.transforms import cofactors
from illumcli.mesh_files.output_mesh import STANDARD, OutputMesh, free_name
from illumcli.mesh_files.split import SplitVertices, split_vertices
from illumcli.records import Record
from illumcli.visibility.baked import Baked


class OutputMeshes(Record):
    """Objects to write, and the values of their vertices."""

    meshes: list[OutputMesh]
    baked: Baked
    left_out: tuple[str, ...]
    """A line for each part of the meshes that is not written."""


def output_meshes(names: Sequence[str], geometry: SceneGeometry, baked: Baked, split: bool) -> OutputMeshes:
    """The objects to write; with `split`, vertices with several normals, uv or values are split."""
    # The tables to write. Without splitting, the corners of each vertex must agree.
    tables: list[dict[str, NDArray[np.float64]]] = []
    left_out: list[str] = []
    for name, placed in zip(names, geometry.placed, strict=True):
        kept: dict[str, NDArray[np.float64]] = {}
        for kind, values in corner_tables(placed).items():
            if values is None:
                left_out.append(f"{name}: {kind}s, which some corners lack")
            elif not split and not is_per_vertex(placed.mesh, values):
                left_out.append(f"{name}: {kind}s that differ between the polygons of a vertex")
            else:
                kept[kind] = values
        tables.append(kept)

    # Split the vertices.
    parts = []
    for placed, table in zip(geometry.placed, tables, strict=True):
        count = len(placed.mesh.corners)
        corners = slice(placed.first_corner, placed.first_corner + count)
        baked_here = [values[corners].reshape(count, -1) for values in baked.corner_channels.values()]
        parts.append(
            split_vertices(
                placed.mesh.corners,
                len(placed.mesh.vertices),
                [*table.values(), *baked_here] if split else [],
            )
        )

    # The objects.
    outputs = [
        output_mesh(name, geometry, index, tables[index], parts[index]) for index, name in enumerate(names)
    ]
    meshes = [placed.mesh for placed in geometry.placed]
    return OutputMeshes(outputs, split_values(baked, meshes, parts) if split else baked, tuple(left_out))


def corner_tables(placed: PlacedMesh) -> dict[str, NDArray[np.float64] | None]:
    """Normals, in scene directions, and uv of the corners of an object's file, (C, k) each, by name; None if
    a corner lacks them."""
    mesh, linear = placed.mesh, placed.matrix[:3, :3]
    tables: dict[str, NDArray[np.float64] | None] = {}
    if mesh.normals is not None and mesh.corner_normals is not None:
        normals = mesh.normals @ cofactors(linear).T * (-1 if placed.mirrored else 1)
        tables["normal"] = normals[mesh.corner_normals] if (mesh.corner_normals >= 0).all() else None
    if mesh.uvs is not None and mesh.corner_uvs is not None:
        tables["uv"] = mesh.uvs[mesh.corner_uvs] if (mesh.corner_uvs >= 0).all() else None
    return tables


def is_per_vertex(mesh: Mesh, values: NDArray[np.float64]) -> bool:
    """True if all corners of every vertex have the same values, (C, k)."""
    out = np.zeros((len(mesh.vertices), values.shape[1]))
    out[mesh.corners] = values
    return np.array_equal(out[mesh.corners], values)


def output_mesh(
    name: str,
    geometry: SceneGeometry,
    index: int,
    tables: Mapping[str, NDArray[np.float64]],
    part: SplitVertices,
) -> OutputMesh:
    """An object in its place, with the attributes of its vertices."""
    # The attributes of the file, and the tables of corners.
    placed = geometry.placed[index]
    mesh = placed.mesh
    attributes: dict[str, NDArray[Any]] = {}
    for attribute, values in mesh.attributes.items():
        is_color = attribute == "color" and values.ndim == 2
        taken = () if is_color else (*STANDARD, *attributes)
        attributes[free_name(attribute, taken)] = values[part.source]
    for kind, values in tables.items():
        at = values[np.maximum(part.corner, 0)]
        attributes[kind] = np.where((part.corner >= 0)[:, None], at, 0.0)

    # The triangles. Reversed polygons regain the order of corners in their file.
    of_object = geometry.objects == index
    corner = geometry.corners[of_object] - np.int32(placed.first_corner)
    if placed.reversed is not None:
        is_reversed = placed.reversed[geometry.polygons[of_object] - placed.first_polygon]
        corner[is_reversed] = corner[is_reversed, ::-1]
    vertices = mesh.vertices @ placed.matrix[:3, :3].T + placed.matrix[:3, 3]
    triangles = part.of_corner[corner]
    return OutputMesh(name, vertices[part.source], part.of_corner, mesh.starts, triangles, attributes)


def split_values(baked: Baked, meshes: Sequence[Mesh], parts: Sequence[SplitVertices]) -> Baked:
    """Values of the split vertices of all meshes: those of their corners if there are any, otherwise of their
    vertices."""
    split: dict[str, list[NDArray[np.float32]]] = {name: [] for name in baked.channels}
    first_vertex = first_corner = 0
    for mesh, part in zip(meshes, parts, strict=True):
        for name, at_vertices in baked.channels.items():
            values = at_vertices[first_vertex + part.source]
            if name in baked.corner_channels:
                some = np.flatnonzero(part.corner >= 0)
                values[some] = baked.corner_channels[name][first_corner + part.corner[some]]
            split[name].append(values)
        first_vertex += len(mesh.vertices)
        first_corner += len(mesh.corners)
    return replace(baked, channels={name: np.concatenate(values) for name, values in split.items()})
