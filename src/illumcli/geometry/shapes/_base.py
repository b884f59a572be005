"""Base of all shapes: frozen parameters of a mesh."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from pydantic import Field

from illumcli.geometry.mesh import Mesh
from illumcli.schema.description import Description
from illumcli.schema.fields import Pair

MAX_TRIANGLES = 20_000_000
"""Largest number of triangles of a shape; the ranges below keep to it."""
TRIANGLE_BYTES = 640
"""Memory per triangle while a mesh is built, placed and passed to Embree; measured 530 to 700 [bytes]."""

Segments: TypeAlias = Annotated[int, Field(ge=3, le=4096)]
Rings: TypeAlias = Annotated[int, Field(ge=1, le=2048)]
Cells: TypeAlias = Annotated[int, Field(ge=1, le=3000)]
CellsByCells: TypeAlias = Pair[Cells]


class Shape(Description):
    """A surface described by a few parameters."""

    def mesh(self) -> Mesh:
        """The surface as polygons, counter-clockwise seen from outside, with exact normals per corner."""
        raise NotImplementedError

    def triangles(self) -> int:
        """Upper bound on the number of triangles, without building the mesh."""
        raise NotImplementedError
