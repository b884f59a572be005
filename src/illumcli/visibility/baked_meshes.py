"""Obscurance in mesh files: which of a file's vertices is each corner of a mesh of the scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.errors import InputError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.scene_geometry import PlacedMesh, SceneGeometry
from illumcli.records import Record, Value

ATTRIBUTES = ("obscurance", "_OBSCURANCE", "quality")
"""Names of obscurance at vertices: of PLY, of glTF, and of PLY as MeshLab writes it."""
SAME_PLACE = 1e-4
"""Distance of positions that count as equal, as a share of the mesh's extent: files have single precision."""
ROUNDING = 1e-5
"""Values may exceed the range from 0 to 1 by so much."""


class User(Value):
    """An object that has a file of obscurance."""

    number: int
    name: str
    users: tuple[int, ...]
    """The numbers of all objects that have this file, ascending."""


class FileVertices(Record):
    """The vertex of a file at each of the C corners of a mesh."""

    of_corner: NDArray[np.int64]  # (C,)
    is_other: bool
    """True if the file's mesh has other positions."""


def attribute_of(mesh: Mesh) -> str | None:
    """The attribute of a mesh that is obscurance; None if it has none."""
    sizes = {name: values.size for name, values in mesh.attributes.items()}
    return next((name for name in ATTRIBUTES if sizes.get(name) == len(mesh.vertices)), None)


def obscurance_at_vertices(path: Path, mesh: Mesh) -> NDArray[np.float32]:
    """(V,) obscurance at the vertices of a mesh file.

    Raises
    ------
    InputError
        The file has none, or numbers beyond 0 to 1.
    """
    name = attribute_of(mesh)
    if name is None:
        raise InputError(
            f"{path}: holds no obscurance; bake it with illum ao-bake, or take it out of the mesh"
        )
    values = mesh.attributes[name].ravel().astype(F)
    low, high = values.min(initial=0), values.max(initial=1)
    if low < -ROUNDING or high > 1 + ROUNDING:
        raise InputError(
            f"{path}: its {name} is from {low:g} to {high:g}, obscurance from 0 to 1; bake it with illum "
            "ao-bake"
        )
    return np.clip(values, 0, 1)


def is_of_one_object(geometry: SceneGeometry, number: int, file: Mesh) -> bool:
    """True if a file's mesh may be that of one object, not several."""
    placed = geometry.placed[geometry.placed_mesh[number]]
    if len(file.group_names) > 1:
        return file is placed.mesh
    counts = placed.mesh.polygon_count, len(_triangles_of(geometry, placed))
    return file.polygon_count in counts or len(file.vertices) == len(placed.mesh.vertices)


def file_vertices(geometry: SceneGeometry, user: User, file: Mesh) -> FileVertices | None:
    """The file's vertex at each corner of the mesh of an object; None if the file is of another mesh.

    A file has the mesh's vertices, its polygons, or its triangles, as `illum ao-bake` writes them; of several
    objects, those of the group of the object's name, or without groups those in the objects' order.
    """
    # The mesh itself.
    placed = geometry.placed[geometry.placed_mesh[user.number]]
    mesh = placed.mesh
    if file is mesh or np.array_equal(file.vertices, mesh.vertices):
        return FileVertices(mesh.corners.astype(np.int64), is_other=False)

    # Its polygons or triangles, corner by corner; those of mirrored objects may be reversed.
    vertex, sizes = _polygons_of(geometry, user, file)
    orders: list[NDArray[np.int64]] = []
    if np.array_equal(sizes, np.diff(mesh.starts)):
        forwards = np.arange(len(mesh.corners))
        orders += [forwards, np.repeat(mesh.starts[:-1] + mesh.starts[1:] - 1, sizes) - forwards]
    if (sizes == 3).all() and len(sizes) == len(_triangles_of(geometry, placed)):
        corner = _corners_of_triangles(geometry, placed)
        orders += [corner, corner.reshape(-1, 3)[:, ::-1].ravel()]
    for corner in orders:
        if _are_in_place(geometry, user, file.vertices[vertex], mesh.corners[corner]):
            of_corner = np.zeros(len(mesh.corners), np.int64)
            of_corner[corner] = vertex
            return FileVertices(of_corner, is_other=False)

    # As many vertices.
    if len(file.vertices) != len(mesh.vertices):
        return None
    every = np.arange(len(mesh.vertices))
    is_other = not _are_in_place(geometry, user, file.vertices, every)
    return FileVertices(mesh.corners.astype(np.int64), is_other)


def _polygons_of(
    geometry: SceneGeometry, user: User, file: Mesh
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """The vertices of the corners of an object's polygons in a file, and the corners of each polygon."""
    # Those of its group.
    sizes, corners = np.diff(file.starts), file.corners.astype(np.int64)
    if user.name in file.group_names and file.polygon_groups is not None:
        own = file.polygon_groups == file.group_names.index(user.name)
        return corners[np.repeat(own, sizes)], sizes[own]

    # Those after the polygons, or triangles, of the objects before it.
    placed = [geometry.placed[geometry.placed_mesh[number]] for number in user.users]
    for counts in (
        [each.mesh.polygon_count for each in placed],
        [len(_triangles_of(geometry, each)) for each in placed],
    ):
        if len(counts) > 1 and sum(counts) == file.polygon_count:
            first = sum(counts[: user.users.index(user.number)])
            end = first + counts[user.users.index(user.number)]
            return corners[file.starts[first] : file.starts[end]], sizes[first:end]
    return corners, sizes


def _triangles_of(geometry: SceneGeometry, placed: PlacedMesh) -> NDArray[np.int32]:
    """(T,) the stored triangles of a mesh."""
    firsts = sorted({each.first_triangle for each in geometry.placed} | {len(geometry.triangles)})
    following = [first for first in firsts if first > placed.first_triangle]
    return np.arange(placed.first_triangle, min(following, default=placed.first_triangle), dtype=np.int32)


def _corners_of_triangles(geometry: SceneGeometry, placed: PlacedMesh) -> NDArray[np.int64]:
    """(3 T,) the corners of a mesh's triangles, in the order in which `illum ao-bake` writes them."""
    triangle = _triangles_of(geometry, placed)
    corner = geometry.corners[triangle].astype(np.int64) - placed.first_corner
    if placed.reversed is not None:
        is_reversed = placed.reversed[geometry.polygons[triangle] - placed.first_polygon]
        corner[is_reversed] = corner[is_reversed, ::-1]
    return corner.ravel()


def _are_in_place(
    geometry: SceneGeometry, user: User, positions: NDArray[np.float64], vertex: NDArray[np.integer[Any]]
) -> bool:
    """True if positions are those of vertices of an object's mesh, as in its file or placed in the scene."""
    mesh = geometry.placed[geometry.placed_mesh[user.number]].mesh
    matrix = geometry.matrices[user.number]
    for linear, offset in ((np.eye(3), np.zeros(3)), (matrix[:3, :3], matrix[:3, 3])):
        there = mesh.vertices[vertex] @ linear.T + offset
        near = SAME_PLACE * np.ptp(there, axis=0).max(initial=0)
        if (np.abs(positions - there) <= near).all():
            return True
    return False
