"""Obscurance baked for the meshes of a scene: values at their corners, interpolated over polygons."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats
from illumcli.errors import InputError
from illumcli.files.located import Located
from illumcli.geometry.repairs import Repair, Repairs, note
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.rays.corner_weights import Corners, CornerWeights
from illumcli.records import Record


class BakedValues(Record):
    """Baked obscurance at corners; objects that share a mesh and a file share the values."""

    values: NDArray[np.float32]  # (K,)
    first: NDArray[np.int64]  # (O,) row of each object's value at corner c is `first` + c
    has_values: NDArray[np.bool_]  # (O,)
    repairs: Repairs


def baked(files: tuple[tuple[str, Located | None], ...], geometry: SceneGeometry) -> BakedValues:
    """The baked values of each object: at corners if its file has them, otherwise at vertices.

    Raises
    ------
    InputError
        A file with values for another number of vertices.
    """
    from illumcli.visibility.baked import Baked, mesh_hash, read_npz

    in_files: dict[Path, Baked] = {}
    tables: list[NDArray[np.float32]] = []
    rows: dict[tuple[Path, int, str], tuple[int, bool]] = {}  # first row, and whether the mesh is another one
    first, has_values = np.zeros(len(files), np.int64), np.zeros(len(files), np.bool_)
    repairs: dict[str, Repair] = {}
    count = 0
    for i, (name, file) in enumerate(files):
        if file is None:
            continue
        number = int(geometry.placed_mesh[i])
        placed = geometry.placed[number]
        mesh = placed.mesh
        if file.path not in in_files:
            in_files[file.path] = read_npz(file.path)
            if "obscurance" not in in_files[file.path].channels:
                raise InputError(f"{file.path}: holds no obscurance; bake it with --what ao")
        in_file = in_files[file.path]

        # Values of a single mesh are those of every object that has it; of several, they go by name.
        key = file.path, number, "" if len(in_file.obscurance) == len(mesh.vertices) else name
        if key not in rows:
            at_corners = in_file.of_corners(name, mesh.corners, len(mesh.vertices))
            if at_corners is None:
                raise InputError(
                    f"{file.path}: holds {len(in_file.obscurance)} values, the mesh of {name} has "
                    f"{len(mesh.vertices)} vertices; bake it again"
                )
            is_other = mesh_hash(mesh.vertices, mesh.corners, mesh.starts) not in in_file.hashes()
            rows[key] = count, is_other
            tables.append(at_corners)
            count += len(at_corners)
        row, is_other = rows[key]
        if is_other:
            note(repairs, "values that were baked for another mesh of as many vertices", str(file.path))
        first[i], has_values[i] = row - placed.first_corner, True
    values = np.concatenate([np.zeros(0, F), *tables]).astype(F)
    return BakedValues(values, first, has_values, repairs)


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
