"""Vertices and faces written in the scene, for textbook examples."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes._base import Shape
from illumcli.schema.description import checks
from illumcli.schema.fields import Many, Vector, Whole

Face = Annotated[tuple[Annotated[int, Whole(ge=0)], ...], Many(least=3)]


class Polygons(Shape):
    shape: Literal["polygons"] = "polygons"
    vertices: Annotated[tuple[Vector, ...], Many(least=3, most=1_000_000)]
    """Positions, at least three [scene units]."""
    faces: Annotated[tuple[Face, ...], Many(least=1, most=1_000_000)]
    """Vertex numbers of each face, from 0, counter-clockwise seen from outside."""
    normals: tuple[Vector, ...] | None = None
    """One per vertex, of any length; by default they follow from the faces."""

    @checks("faces")
    def _names_vertices(faces: tuple[Face, ...], before: Mapping[str, Any]) -> None:
        count = len(before.get("vertices", ()))
        for number, face in enumerate(faces):
            strange = [vertex for vertex in face if vertex >= count]
            if count and strange:
                raise ValueError(f"face {number} names vertex {strange[0]}, the last one is {count - 1}")

    @checks("normals")
    def _one_per_vertex(normals: tuple[Vector, ...] | None, before: Mapping[str, Any]) -> None:
        count = len(before.get("vertices", ()))
        if normals is None or not count:
            return
        if len(normals) != count:
            raise ValueError(f"there must be one per vertex, {count}, there are {len(normals)}")
        for number, normal in enumerate(normals):
            if not any(normal):
                raise ValueError(f"normal {number} is zero")

    def triangles(self) -> int:
        return sum(len(face) - 2 for face in self.faces)

    def mesh(self) -> Mesh:
        """The faces as they are."""
        corners = np.concatenate(self.faces).astype(np.int32)
        return Mesh(
            vertices=np.array(self.vertices, np.float64),
            corners=corners,
            starts=np.cumsum([0, *map(len, self.faces)]).astype(np.int32),
            normals=None if self.normals is None else np.array(self.normals, np.float64),
            corner_normals=None if self.normals is None else corners.copy(),
        )
