"""The objects of a bake as they are written: their vertices as they stand, or split by what corners have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.scene_geometry import PlacedMesh, SceneGeometry, cofactors
from illumcli.mesh_files.output_mesh import STANDARD, OutputMesh, free_name
from illumcli.records import Record
from illumcli.visibility.baked import Baked


def shapes_of(
    names: Sequence[str], world: SceneGeometry, baked: Baked, divided: bool, left_out: list[str]
) -> tuple[list[OutputMesh], Baked]:
    """The objects as they are written, and the values of their vertices; `divided` where vertices with
    several normals, uv or values are."""
    # what corners have; of vertices that are not divided only what all their corners agree on
    tables: list[dict[str, NDArray[np.float64]]] = []
    for name, placed in zip(names, world.placed, strict=True):
        kept: dict[str, NDArray[np.float64]] = {}
        for kind, values in corner_tables(placed).items():
            if values is None:
                left_out.append(f"{name}: {kind}s, which some corners lack")
            elif not divided and not per_vertex(placed.mesh, values):
                left_out.append(f"{name}: {kind}s that differ between the polygons of a vertex")
            else:
                kept[kind] = values
        tables.append(kept)
    meshes = [placed.mesh for placed in world.placed]

    # what vertices become
    parts = []
    for placed, own in zip(world.placed, tables, strict=True):
        count = len(placed.mesh.corners)
        part = slice(placed.first_corner, placed.first_corner + count)
        found = [column[part].reshape(count, -1) for column in baked.corner_columns().values()]
        parts.append(copies(placed.mesh, [*own.values(), *found] if divided else []))
    made = [
        shape_of(names[number], world, number, own, part)
        for number, (own, part) in enumerate(zip(tables, parts, strict=True))
    ]
    return made, split_values(baked, meshes, parts) if divided else baked


def corner_tables(placed: PlacedMesh) -> dict[str, NDArray[np.float64] | None]:
    """What every corner of an object's file has, by name, (C, k), normals in scene directions; None where
    some corner has it not."""
    mesh, linear = placed.mesh, placed.matrix[:3, :3]
    found: dict[str, NDArray[np.float64] | None] = {}
    if mesh.normals is not None and mesh.corner_normals is not None:
        turned = mesh.normals @ cofactors(linear).T * (-1 if placed.mirrored else 1)
        found["normal"] = turned[mesh.corner_normals] if (mesh.corner_normals >= 0).all() else None
    if mesh.uvs is not None and mesh.corner_uvs is not None:
        found["uv"] = mesh.uvs[mesh.corner_uvs] if (mesh.corner_uvs >= 0).all() else None
    return found


def per_vertex(mesh: Mesh, values: NDArray[np.float64]) -> bool:
    """Do all corners of every vertex have the same of these values, (C, k)?"""
    out = np.zeros((len(mesh.vertices), values.shape[1]))
    out[mesh.corners] = values
    return np.array_equal(out[mesh.corners], values)


def shape_of(
    name: str, world: SceneGeometry, number: int, tables: Mapping[str, NDArray[np.float64]], own: Copies
) -> OutputMesh:
    """An object in its place, with what its vertices have."""
    placed = world.placed[number]
    mesh = placed.mesh
    attributes: dict[str, NDArray[Any]] = {}
    for own_name, values in mesh.attributes.items():
        is_color = own_name == "color" and values.ndim == 2
        taken = () if is_color else (*STANDARD, *attributes)
        attributes[free_name(own_name, taken)] = values[own.source]
    for kind, values in tables.items():
        at = values[np.maximum(own.corner, 0)]
        attributes[kind] = np.where((own.corner >= 0)[:, None], at, 0.0)
    mine = world.objects == number
    corner = world.corners[mine] - np.int32(placed.first_corner)
    if placed.reversed is not None:  # files keep the order of their corners
        other_way = placed.reversed[world.polygons[mine] - placed.first_polygon]
        corner[other_way] = corner[other_way, ::-1]
    vertices = mesh.vertices @ placed.matrix[:3, :3].T + placed.matrix[:3, 3]
    triangles = own.number[corner]
    return OutputMesh(name, vertices[own.source], own.number, mesh.starts, triangles, attributes)


class Copies(Record):
    """The vertices of a mesh, and behind them a copy for all that a vertex has beyond its first."""

    source: NDArray[np.int64]  # (N,) vertex that each is, or is a copy of
    corner: NDArray[np.int64]  # (N,) a corner that has it, -1 for vertices of no polygon
    number: NDArray[np.int32]  # (C,) which of them each corner has


def copies(mesh: Mesh, tables: Sequence[NDArray[Any]]) -> Copies:
    """One for each vertex, and one more for every other row of `tables` that its corners have.

    Parameters
    ----------
    tables : of (C, k)
        What a corner has: normals, uv, values.
    """
    # one number for all that a corner has
    key = mesh.corners.astype(np.int64)
    for table in tables:
        _, row = np.unique(table, axis=0, return_inverse=True)
        _, key = np.unique(key * (len(table) + 1) + row.ravel(), return_inverse=True)
        key = key.ravel()
    _, first, key = np.unique(key, return_index=True, return_inverse=True)

    # the first that a vertex has is its own, others follow behind all vertices
    count = len(mesh.vertices)
    order = np.argsort(first, kind="stable")
    vertex = mesh.corners[first[order]]
    own = np.zeros(len(order), bool)
    own[np.unique(vertex, return_index=True)[1]] = True
    number = np.empty(len(order), np.int32)
    number[order] = np.where(own, vertex, count + np.cumsum(~own) - 1)
    corner = np.full(count + int((~own).sum()), -1, np.int64)
    corner[number] = first
    source = np.concatenate([np.arange(count), vertex[~own]])
    return Copies(source, corner, number[key.ravel()])


def split_values(baked: Baked, meshes: Sequence[Mesh], parts: Sequence[Copies]) -> Baked:
    """Values of the copies of all meshes: those of their corners where there are any, else of vertices."""
    made: dict[str, list[NDArray[Any]]] = {name: [] for name in baked.columns()}
    at_corners = baked.corner_columns()
    first_vertex = first_corner = 0
    for mesh, own in zip(meshes, parts, strict=True):
        for name, column in baked.columns().items():
            values = column[first_vertex + own.source]
            if f"corner_{name}" in at_corners:
                some = np.flatnonzero(own.corner >= 0)
                values[some] = at_corners[f"corner_{name}"][first_corner + own.corner[some]]
            made[name].append(values)
        first_vertex += len(mesh.vertices)
        first_corner += len(mesh.corners)
    joined: dict[str, Any] = {name: np.concatenate(values) for name, values in made.items()}
    return replace(baked, **joined)
