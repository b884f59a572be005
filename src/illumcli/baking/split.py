"""The objects of a bake as they are written: with the vertices of the mesh, or with vertices split where
their corners differ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.baking.baked_texture import TextureUvs
from illumcli.baking.obj_files import reversed_corners
from illumcli.baking.points import Surfaces
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.geometry.transforms import cofactors
from illumcli.mesh_files.output_mesh import STANDARD, TEXTURE_UV, OutputMesh, free_name
from illumcli.mesh_files.pbr import PbrMaterial
from illumcli.mesh_files.split import SplitVertices, split_vertices
from illumcli.records import Record
from illumcli.visibility.baked import Baked

NONE: Mapping[int, TextureUvs] = {}


class OutputMeshes(Record):
    """Objects to write, and the values of their vertices."""

    meshes: list[OutputMesh]
    baked: Baked
    left_out: tuple[str, ...] = ()
    """The parts of the meshes that they lack."""


def whole_meshes(names: Sequence[str], surfaces: Surfaces, baked: Baked) -> OutputMeshes:
    """The objects with the vertices of their meshes; normals and uv only where each vertex has one."""
    outputs, left_out = [], []
    for index, name in enumerate(names):
        mesh = surfaces.geometry.placed[index].mesh
        tables = corner_tables(surfaces, index, fill=False)
        for kind in [kind for kind, values in tables.items() if not is_per_vertex(mesh, values)]:
            del tables[kind]
            left_out.append(f"{kind}s of {name} that differ between the polygons of a vertex")
        same = split_vertices(mesh.corners, len(mesh.vertices), [])
        outputs.append(output_mesh(name, surfaces, index, tables, same))
    return OutputMeshes(outputs, baked, tuple(left_out))


def split_meshes(
    names: Sequence[str],
    surfaces: Surfaces,
    baked: Baked,
    fill: bool,
    unwrapped: Mapping[int, TextureUvs] = NONE,
) -> OutputMeshes:
    """The objects with vertices split where corners have several normals, uv or values.

    `fill` is that of `corner_tables`; `unwrapped` has uv of textures that are not those of the file, by
    object.
    """
    outputs, parts = [], []
    meshes = [placed.mesh for placed in surfaces.geometry.placed]
    for index, (name, mesh) in enumerate(zip(names, meshes, strict=True)):
        tables = corner_tables(surfaces, index, fill)
        corners = np.arange(len(mesh.corners), dtype=np.int32)
        if index in unwrapped:
            # seams may run inside polygons: every triangle has corners of its own
            corners = corners_of_triangles(surfaces.geometry, index).ravel()
            tables = {kind: values[corners] for kind, values in tables.items()}
            tables[TEXTURE_UV] = unwrapped[index].uvs[unwrapped[index].corner_uvs].reshape(-1, 2)
        first = surfaces.geometry.placed[index].first_corner
        values = [each[first + corners].reshape(len(corners), -1) for each in baked.corner_channels.values()]
        part = split_vertices(mesh.corners[corners], len(mesh.vertices), [*tables.values(), *values])
        outputs.append(output_mesh(name, surfaces, index, tables, part))
        has_corner = part.corner >= 0
        parts.append(replace(part, corner=np.where(has_corner, corners[part.corner], -1)))
    return OutputMeshes(outputs, split_values(baked, meshes, parts))


def corners_of_triangles(geometry: SceneGeometry, index: int) -> NDArray[np.int32]:
    """(T, 3) corner numbers, in its mesh, of the triangles of an object."""
    first = geometry.placed[index].first_corner
    return np.asarray(geometry.corners[geometry.objects == index] - np.int32(first))


def split_by_values(mesh: Mesh, baked: Baked) -> tuple[SplitVertices, Baked]:
    """The vertices of a mesh baked alone, split where corners have several values, and their values."""
    values = [each.reshape(len(mesh.corners), -1) for each in baked.corner_channels.values()]
    part = split_vertices(mesh.corners, len(mesh.vertices), values)
    return part, split_values(baked, [mesh], [part])


def corner_tables(surfaces: Surfaces, index: int, fill: bool) -> dict[str, NDArray[np.float64]]:
    """Normals, in scene directions, and uv of the corners of an object's file, (C, k) each, by name.

    Corners without uv have (0, 0), and without a normal the one that the bake shades with.

    Parameters
    ----------
    fill
        True: an object whose file has no normals has those that the bake shades with.
    """
    placed = surfaces.geometry.placed[index]
    mesh, linear = placed.mesh, placed.matrix[:3, :3]
    tables: dict[str, NDArray[np.float64]] = {}
    in_file = mesh.normals is not None and mesh.corner_normals is not None
    if in_file or fill:
        rows = surfaces.normals.index[placed.first_corner : placed.first_corner + len(mesh.corners)]
        tables["normal"] = surfaces.normals.values[rows].astype(np.float64)
    if mesh.normals is not None and mesh.corner_normals is not None:
        normals = mesh.normals @ cofactors(linear).T * (-1 if placed.mirrored else 1)
        has_normal = mesh.corner_normals >= 0
        tables["normal"][has_normal] = normals[mesh.corner_normals[has_normal]]
    if mesh.uvs is not None and mesh.corner_uvs is not None:
        has_uv = mesh.corner_uvs[:, None] >= 0
        tables["uv"] = np.where(has_uv, mesh.uvs[np.maximum(mesh.corner_uvs, 0)], 0.0)
    return tables


def is_per_vertex(mesh: Mesh, values: NDArray[np.float64]) -> bool:
    """True if all corners of every vertex have the same values, (C, k)."""
    out = np.zeros((len(mesh.vertices), values.shape[1]))
    out[mesh.corners] = values
    return np.array_equal(out[mesh.corners], values)


def output_mesh(
    name: str,
    surfaces: Surfaces,
    index: int,
    tables: Mapping[str, NDArray[np.float64]],
    part: SplitVertices,
) -> OutputMesh:
    """An object in its place, with the attributes of its vertices."""
    # The attributes of the file, and the tables of corners.
    geometry = surfaces.geometry
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
    corner = corners_of_triangles(geometry, index)
    starts, written = mesh.starts, part.of_corner
    if TEXTURE_UV in tables:  # every triangle has corners of its own
        corner = np.arange(corner.size, dtype=np.int32).reshape(-1, 3)
        starts = np.arange(0, corner.size + 1, 3, dtype=np.int32)
    elif placed.mirrored:
        written = written[reversed_corners(mesh)]
    polygons = geometry.polygons[geometry.objects == index] - placed.first_polygon
    if placed.reversed is not None:
        is_reversed = placed.reversed[polygons]
        corner[is_reversed] = corner[is_reversed, ::-1]
    vertices = mesh.vertices @ placed.matrix[:3, :3].T + placed.matrix[:3, 3]
    return OutputMesh(
        name,
        vertices[part.source],
        written,
        starts,
        part.of_corner[corner],
        attributes,
        mesh.group_names,
        None if mesh.polygon_groups is None else mesh.polygon_groups[polygons],
        tuple(PbrMaterial(each) for each in mesh.material_names),
        None if mesh.polygon_materials is None else mesh.polygon_materials[polygons],
    )


def with_materials(mesh: OutputMesh, materials: Mapping[str, PbrMaterial]) -> OutputMesh:
    """The object with those of its materials that are known by name."""
    return replace(mesh, materials=tuple(materials.get(each.name, each) for each in mesh.materials))


def split_values(baked: Baked, meshes: Sequence[Mesh], parts: Sequence[SplitVertices]) -> Baked:
    """Values of the split vertices of all meshes: those of their corners if there are any, otherwise of their
    vertices."""
    split: dict[str, list[NDArray[np.float32]]] = {name: [] for name in baked.channels}
    vertex = corner = 0
    for mesh, part in zip(meshes, parts, strict=True):
        vertices, corners = (
            slice(vertex, vertex + len(mesh.vertices)),
            slice(corner, corner + len(mesh.corners)),
        )
        columns = part.columns(
            {name: each[vertices] for name, each in baked.channels.items()},
            {name: each[corners] for name, each in baked.corner_channels.items()},
        )
        for name, values in columns.items():
            split[name].append(values)
        vertex, corner = vertices.stop, corners.stop
    return replace(baked, channels={name: np.concatenate(values) for name, values in split.items()})
