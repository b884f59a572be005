"""The input of writers: meshes, and values at their vertices."""

from __future__ import annotations

from collections.abc import Container, Mapping
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.files.seal import BLANK
from illumcli.mesh_files.color_change import ColorChange
from illumcli.mesh_files.pbr import PbrMaterial
from illumcli.records import Record

STANDARD = ("normal", "uv", "color")
"""Attributes that every format has its own form for; others keep their name where the format allows."""

TEXTURE_UV = "uv of textures"
"""Attribute with the uv of an object's baked textures, if they are not `uv`."""


class OutputMesh(Record):
    """One object to write: polygons over vertices in the order of the input file."""

    name: str
    vertices: NDArray[np.float64]  # (V, 3)
    corners: NDArray[np.int32]  # (C,) vertex of each polygon corner
    starts: NDArray[np.int32]  # (P + 1,)
    triangles: NDArray[np.int32]  # (T, 3) vertex numbers
    attributes: Mapping[str, NDArray[Any]]  # per vertex: `normal`, `uv`, `color` (linear), and any others
    group_names: tuple[str, ...] = ()
    triangle_groups: NDArray[np.int32] | None = None  # (T,) index in `group_names`, -1 none
    materials: tuple[PbrMaterial, ...] = ()
    triangle_materials: NDArray[np.int32] | None = None  # (T,) index in `materials`, -1 none


class VertexData(Record):
    """Values to add at the V vertices of a file, those of all its meshes one after the other."""

    columns: Mapping[str, NDArray[np.float32]]  # (V,) or (V, k) by name
    about: Mapping[str, Any]  # JSON metadata
    color: ColorChange | None = None  # what the column `obscurance` does to colours
    corner_columns: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)
    """(C,) or (C, k) by the names of columns, where vertices have several values."""

    def sealed_about(self) -> dict[str, Any]:
        """`about`, with a placeholder for the file's own hash."""
        return {**self.about, "body": BLANK}


def fits_single(vertices: NDArray[np.float64]) -> bool:
    """True if rounding to single precision moves no vertex by more than 10^-6 of the mesh's size."""
    size = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    return bool(np.abs(vertices - vertices.astype(np.float32)).max(initial=0) <= 1e-6 * size)


def free_name(name: str, taken: Container[str]) -> str:
    """`name` with as many underscores appended as needed to be unused."""
    while name in taken:
        name += "_"
    return name
