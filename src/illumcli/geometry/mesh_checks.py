"""Faults of a mesh's polygons and normals that rendering can cope with, counted per class."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.polygon_normals import area_vectors, reversed_polygons
from illumcli.geometry.repairs import Repair, Repairs

Place: TypeAlias = Callable[[str, int], str]
"""The place of part ('vertex', 'face', 'normal', 'uv') number n, from 0, written as `Repair.first`."""


def numbered(part: str, index: int) -> str:
    """The place of a part that has no line: its number from 1."""
    return f": {part} {index + 1}"


def faults(mesh: Mesh, place: Place = numbered) -> Repairs:
    """The repairs while the mesh was read, and the faults that rendering tolerates.

    Faces without area are never hit, zero normals are replaced by computed ones, faces that run clockwise
    about their normals are reversed, unused vertices are ignored, for the scene's size too.
    """
    used = np.zeros(len(mesh.vertices), np.bool_)
    used[mesh.corners] = True
    wrong: dict[str, tuple[str, NDArray[np.bool_]]] = {
        "unused vertices": ("vertex", ~used),
        "faces without area": ("face", ~np.any(area_vectors(mesh), axis=1)),
    }
    if mesh.normals is not None:
        is_valid = np.isfinite(mesh.normals).all(axis=1) & np.any(mesh.normals, axis=1)
        wrong["normals not finite or of no length"] = ("normal", ~is_valid)
    if (reversed_ := reversed_polygons(mesh)) is not None:
        wrong["faces that run clockwise about their normals"] = ("face", reversed_)
    return {**mesh.repairs, **_counted(wrong, place), **mesh.repairs}


def _counted(wrong: dict[str, tuple[str, NDArray[np.bool_]]], place: Place) -> dict[str, Repair]:
    return {
        what: Repair(int(np.count_nonzero(which)), place(part, int(np.argmax(which))))
        for what, (part, which) in wrong.items()
        if which.any()
    }
