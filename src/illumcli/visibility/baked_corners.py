"""Obscurance baked for the meshes of a scene: values at their corners, interpolated over polygons."""

from __future__ import annotations

import numpy as np

from illumcli.arrays import F, Floats
from illumcli.errors import InputError
from illumcli.files.located import Located
from illumcli.geometry.repairs import Repair, Repairs, note
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry
from illumcli.rays.corner_weights import CornerWeights
from illumcli.records import Record


class BakedValues(Record):
    """Baked obscurance at the scene's corners."""

    values: CornerVectors  # (C, 1) NaN on meshes without baked values
    repairs: Repairs


def baked(files: tuple[tuple[str, Located | None], ...], geometry: SceneGeometry) -> BakedValues:
    """The baked values of each object: at corners if its file has them, otherwise at vertices.

    Raises
    ------
    InputError
        A file with values for another number of vertices.
    """
    from illumcli.visibility.baked import mesh_hash, read_npz

    values = np.full((sum(len(placed.mesh.corners) for placed in geometry.placed), 1), np.nan, F)
    repairs: dict[str, Repair] = {}
    for (name, file), placed in zip(files, geometry.placed, strict=True):
        if file is None:
            continue
        mesh, in_file = placed.mesh, read_npz(file.path)
        at_corners = in_file.of_corners(name, mesh.corners, len(mesh.vertices))
        if at_corners is None:
            raise InputError(
                f"{file.path}: holds {len(in_file.obscurance)} values, the mesh of {name} has "
                f"{len(mesh.vertices)} vertices; bake it again"
            )
        if mesh_hash(mesh.vertices, mesh.corners, mesh.starts) not in in_file.hashes():
            note(repairs, "values that were baked for another mesh of as many vertices", str(file.path))
        values[placed.first_corner : placed.first_corner + len(at_corners), 0] = at_corners
    return BakedValues(CornerVectors(values, np.arange(len(values), dtype=np.int32)), repairs)


def baked_obscurance(geometry: SceneGeometry, baked: BakedValues, corner_weights: CornerWeights) -> Floats:
    """(M,) baked values interpolated over polygons; NaN on meshes without baked values."""
    w: Floats = corner_weights.interpolate(geometry, baked.values)[:, 0]
    return w
