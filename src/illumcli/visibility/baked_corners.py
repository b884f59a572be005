"""Obscurance baked for the meshes of a scene: values at their corners, interpolated over polygons."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats
from illumcli.errors import InputError
from illumcli.files.located import Located
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.repairs import Repair, Repairs, note
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.rays.corner_weights import Corners, CornerWeights
from illumcli.records import Record
from illumcli.visibility.baked_meshes import (
    User,
    file_vertices,
    is_of_one_object,
    obscurance_at_vertices,
)

if TYPE_CHECKING:
    from illumcli.visibility.baked import Baked

Files: TypeAlias = tuple[tuple[str, Located | None], ...]
"""The name of each object, and the file of its obscurance, if any."""


class BakedValues(Record):
    """Baked obscurance at corners; objects that share a mesh and a file share the values."""

    values: NDArray[np.float32]  # (K,)
    first: NDArray[np.int64]  # (O,) row of each object's value at corner c is `first` + c
    has_values: NDArray[np.bool_]  # (O,)
    repairs: Repairs


def baked(
    files: Files, geometry: SceneGeometry, obscurance_meshes: tuple[Mesh | None, ...] | None = None
) -> BakedValues:
    """The baked values of each object: at corners if its file has them, otherwise at vertices; none where the
    file has textures.

    Parameters
    ----------
    files
        Name and file of each object.
    obscurance_meshes
        The meshes in those that are mesh files.

    Raises
    ------
    InputError
        A file of another mesh, or without obscurance.
    """
    from illumcli.visibility.baked import read_npz

    in_files: dict[Path, Baked] = {}
    tables: list[NDArray[np.float32]] = []
    rows: dict[tuple[Path, int, str], tuple[int, bool]] = {}  # first row, and whether the mesh is another one
    first, has_values = np.zeros(len(files), np.int64), np.zeros(len(files), np.bool_)
    repairs: dict[str, Repair] = {}
    count = 0
    for i, (name, file) in enumerate(files):
        in_mesh = None if obscurance_meshes is None else obscurance_meshes[i]
        if file is None or has_textures(file, in_mesh):
            continue
        number = int(geometry.placed_mesh[i])
        placed = geometry.placed[number]
        if in_mesh is None and file.path not in in_files:
            in_files[file.path] = read_npz(file.path)
            if "obscurance" not in in_files[file.path].channels:
                raise InputError(f"{file.path}: holds no obscurance; bake it with --what ao")

        # Values of a single mesh are those of every object that has it; of several, they go by name.
        if in_mesh is None:
            is_single = len(in_files[file.path].obscurance) == len(placed.mesh.vertices)
        else:
            is_single = is_of_one_object(geometry, i, in_mesh)
        key = file.path, number, "" if is_single else name
        if key not in rows:
            if in_mesh is None:
                at_corners, is_other = _values_of_npz(file.path, in_files[file.path], placed.mesh, name)
            else:
                users = tuple(k for k, (_, other) in enumerate(files) if other and other.path == file.path)
                user = User(i, name, users)
                at_corners, is_other = _values_of_mesh(file.path, in_mesh, geometry, user)
            rows[key] = count, is_other
            tables.append(at_corners)
            count += len(at_corners)
        row, is_other = rows[key]
        if is_other:
            note(repairs, "values that were baked for another mesh of as many vertices", str(file.path))
        first[i], has_values[i] = row - placed.first_corner, True
    values = np.concatenate([np.zeros(0, F), *tables]).astype(F)
    return BakedValues(values, first, has_values, repairs)


def has_textures(file: Located, in_mesh: Mesh | None) -> bool:
    """True if a file of obscurance has it in textures: an image, or glTF whose occlusion textures count."""
    if in_mesh is None:
        return file.path.suffix.lower() != ".npz"
    return bool(in_mesh.occlusion)


def _values_of_npz(path: Path, in_file: Baked, mesh: Mesh, name: str) -> tuple[NDArray[np.float32], bool]:
    """(C,) the values of an object at its mesh's corners, and whether they were baked for another mesh."""
    from illumcli.visibility.baked import mesh_hash

    at_corners = in_file.of_corners(name, mesh.corners, len(mesh.vertices))
    if at_corners is None:
        raise InputError(
            f"{path}: holds {len(in_file.obscurance)} values, the mesh of {name} has "
            f"{len(mesh.vertices)} vertices; bake it again"
        )
    return at_corners, mesh_hash(mesh.vertices, mesh.corners, mesh.starts) not in in_file.hashes()


def _values_of_mesh(
    path: Path, in_file: Mesh, geometry: SceneGeometry, user: User
) -> tuple[NDArray[np.float32], bool]:
    """The same, of a mesh file."""
    values = obscurance_at_vertices(path, in_file)
    vertices = file_vertices(geometry, user, in_file)
    if vertices is None:
        mesh = geometry.placed[geometry.placed_mesh[user.number]].mesh
        raise InputError(
            f"{path}: has {in_file.polygon_count} polygons of {len(in_file.vertices)} vertices, the mesh of "
            f"{user.name} has {mesh.polygon_count} of {len(mesh.vertices)}, or others; bake it again"
        )
    return values[vertices.of_corner], vertices.is_other


def baked_obscurance(geometry: SceneGeometry, baked: BakedValues, corner_weights: CornerWeights) -> Floats:
    """(M,) baked values interpolated over polygons; NaN on meshes without baked values."""

    def at_corner(group: Corners, k: int) -> NDArray[np.float32]:
        has_values = baked.has_values.take(group.objects)
        row = np.where(has_values, baked.first.take(group.objects) + group.corner(geometry, k), 0)
        if not len(baked.values):
            return np.full((len(row), 1), np.nan, F)
        return np.where(has_values, baked.values.take(row), F(np.nan))[:, None]

    w: Floats = corner_weights.weighted_mean(at_corner)[:, 0]
    return w
