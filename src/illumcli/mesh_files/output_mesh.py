"""Meshes as they are handed to the writers, and what is written of their vertices beside."""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.files.seal import BLANK
from illumcli.records import Record

STANDARD = ("normal", "uv", "color")
"""Attributes that every format has a form of its own for; all others keep their name as far as it can."""


class OutputMesh(Record):
    """One object as it is written: polygons over vertices that keep their order and count."""

    name: str
    vertices: NDArray[np.float64]  # (V, 3)
    corners: NDArray[np.int32]  # (C,) vertex of each polygon corner
    starts: NDArray[np.int32]  # (P + 1,)
    triangles: NDArray[np.int32]  # (T, 3) vertex numbers
    attributes: Mapping[str, NDArray[Any]]  # per vertex: `normal`, `uv`, `color` (linear), and any others


class VertexData(Record):
    """Values added to the V vertices of a file, those of all its meshes one after the other."""

    columns: Mapping[str, NDArray[np.float32]]  # (V,) or (V, k) by name
    about: Mapping[str, Any]  # JSON that the file says of them
    color: NDArray[np.uint8] | None = None  # (V,) linear, written into the colour channels `channels`
    channels: tuple[int, ...] = ()  # of 0 red, 1 green, 2 blue, 3 alpha

    def sealed_about(self) -> dict[str, Any]:
        """`about`, with a place for the file's own hash."""
        return {**self.about, "body": BLANK}


def fits_single(vertices: NDArray[np.float64]) -> bool:
    """Does rounding to single precision move no vertex by more than 10^-6 of the mesh's size?"""
    size = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    return bool(np.abs(vertices - vertices.astype(np.float32)).max(initial=0) <= 1e-6 * size)


def free_name(name: str, taken: Container[str]) -> str:
    """`name`, with underscores behind it until it is not taken."""
    while name in taken:
        name += "_"
    return name
