"""Obscurance baked for the meshes of a scene: values at their corners, interpolated over polygons."""

from __future__ import annotations

from collections.abc import Iterator
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
    for user, path, in_mesh in file_users(files, obscurance_meshes, in_textures=False):
        number = int(geometry.placed_mesh[user.number])
        placed = geometry.placed[number]
        if in_mesh is None and path not in in_files:
            in_files[path] = read_npz(path)
            if "obscurance" not in in_files[path].channels:
                raise InputError(f"{path}: holds no obscurance; bake it with --what ao")

        # Values of a single mesh are those of every object that has it; of several, they go by name.
        if in_mesh is None:
            is_single = len(in_files[path].obscurance) == len(placed.mesh.vertices)
        else:
            is_single = is_of_one_object(geometry, user.number, in_mesh)
        key = path, number, "" if is_single else user.name
        if key not in rows:
            if in_mesh is None:
                at_corners, is_other = _values_of_npz(path, in_files[path], placed.mesh, user.name)
            else:
                at_corners, is_other = _values_of_mesh(path, in_mesh, geometry, user)
            rows[key] = count, is_other
            tables.append(at_corners)
            count += len(at_corners)
        row, is_other = rows[key]
        if is_other:
            note(repairs, "values that were baked for another mesh of as many vertices", str(path))
        first[user.number], has_values[user.number] = row - placed.first_corner, True
    values = np.concatenate([np.zeros(0, F), *tables]).astype(F)
    return BakedValues(values, first, has_values, repairs)


def file_users(
    files: Files, obscurance_meshes: tuple[Mesh | None, ...] | None, in_textures: bool
) -> Iterator[tuple[User, Path, Mesh | None]]:
    """The objects whose file of obscurance has it in textures, or in values; the file, and the mesh in it if
    it is a mesh file."""
    numbers: dict[Path, list[int]] = {}
    for number, (_, file) in enumerate(files):
        if file is not None:
            numbers.setdefault(file.path, []).append(number)
    users = {path: tuple(of_path) for path, of_path in numbers.items()}
    for number, (name, file) in enumerate(files):
        in_mesh = None if obscurance_meshes is None else obscurance_meshes[number]
        if file is not None and _has_textures(file.path, in_mesh) == in_textures:
            yield User(number, name, users[file.path]), file.path, in_mesh


def _has_textures(path: Path, in_mesh: Mesh | None) -> bool:
    """True if a file of obscurance has it in textures: an image, or glTF whose occlusion textures count."""
    if in_mesh is None:
        return path.suffix.lower() != ".npz"
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
