"""Vertices and faces written in the scene, for textbook examples."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from illumcli.geometry.mesh import Mesh
from illumcli.geometry.shapes._base import Shape
from illumcli.schema.fields import ListOf, Vector

Face: TypeAlias = Annotated[ListOf[Annotated[int, Field(ge=0)]], Field(min_length=3)]


class Polygons(Shape):
    shape: Literal["polygons"] = "polygons"
    vertices: Annotated[ListOf[Vector], Field(min_length=3, max_length=1_000_000)]
    """Positions, at least three [scene units]."""
    faces: Annotated[ListOf[Face], Field(min_length=1, max_length=1_000_000)]
    """Vertex numbers of each face, from 0, counter-clockwise seen from outside."""
    normals: ListOf[Vector] | None = None
    """One per vertex, of any length; by default they follow from the faces."""

    @field_validator("faces")
    @classmethod
    def _names_vertices(cls, faces: tuple[Face, ...], info: ValidationInfo) -> tuple[Face, ...]:
        count = len(info.data.get("vertices", ()))
        for number, face in enumerate(faces):
            strange = [vertex for vertex in face if vertex >= count]
            if count and strange:
                raise ValueError(f"face {number} names vertex {strange[0]}, the last one is {count - 1}")
        return faces

    @field_validator("normals")
    @classmethod
    def _one_per_vertex(
        cls, normals: tuple[Vector, ...] | None, info: ValidationInfo
    ) -> tuple[Vector, ...] | None:
        count = len(info.data.get("vertices", ()))
        if normals is None or not count:
            return normals
        if len(normals) != count:
            raise ValueError(f"there must be one per vertex, {count}, there are {len(normals)}")
        for number, normal in enumerate(normals):
            if not any(normal):
                raise ValueError(f"normal {number} is zero")
        return normals

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
