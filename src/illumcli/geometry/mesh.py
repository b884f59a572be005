"""Mesh: polygons over shared vertices, exactly as in the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from illumcli.geometry.repairs import Repairs
from illumcli.records import Record, Value


class Substitute(Value):
    """The colour that replaces a texture, of a mesh's own material, that cannot be used."""

    value: tuple[float, ...]  # linear colour
    first: str = ""  # where the file names the texture, written as `Repair.first`


class Mesh(Record):
    """Polygons over vertices in the file's own order and count; nothing is merged.

    Polygon p owns the corners ``starts[p]:starts[p + 1]``, counter-clockwise seen from outside. Normals and
    uv are indexed per corner, so seams and creases need no copies of vertices. Arrays are read-only.
    """

    vertices: NDArray[np.float64]  # (V, 3) as read
    corners: NDArray[np.int32]  # (C,) vertex of each polygon corner
    starts: NDArray[np.int32]  # (P + 1,) first corner of each polygon, and the end
    normals: NDArray[np.float64] | None = None  # (K, 3) as read, of any length
    corner_normals: NDArray[np.int32] | None = None  # (C,) row of `normals`, -1 where the corner has none
    uvs: NDArray[np.float64] | None = None  # (U, 2), v upwards
    corner_uvs: NDArray[np.int32] | None = None  # (C,) row of `uvs`, -1 where the corner has none
    material_names: tuple[str, ...] = ()  # names the file selects (`usemtl`)
    polygon_materials: NDArray[np.int32] | None = None  # (P,) index in `material_names`, -1 none
    group_names: tuple[str, ...] = ()
    polygon_groups: NDArray[np.int32] | None = None  # (P,) index in `group_names`, -1 none
    polygon_smoothing: NDArray[np.int32] | None = None  # (P,) smoothing group, 0 off (facetted), -1 not given
    attributes: Mapping[str, NDArray[Any]] = field(default_factory=dict)
    """The file's properties per vertex, (V,) or (V, k); vertex colours are `color`, (V, 3) linear."""
    materials: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """Material name -> keys of a scene's material, from the file's own library. Paths of textures
    begin with the mesh's folder; in a cached mesh they are relative to it."""
    substitutes: Mapping[str, Mapping[str, Substitute]] = field(default_factory=dict)
    """Material name -> key -> the colour that replaces its texture; white by default."""
    occlusion: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """Material name -> keys of a texture whose red channel is obscurance, and its `strength`; empty if an
    attribute has the obscurance that counts."""
    material_repairs: Repairs = field(default_factory=dict)
    """Differences from the material library; reported if a scene uses the material."""
    repairs: Repairs = field(default_factory=dict)
    """Repairs and omissions while reading; places are relative to the mesh's file."""

    def __post_init__(self) -> None:
        for array in [*vars(self).values(), *self.attributes.values()]:
            if isinstance(array, np.ndarray):
                array.setflags(write=False)

    @property
    def polygon_count(self) -> int:
        return len(self.starts) - 1

    @classmethod
    def of_triangles(cls, vertices: ArrayLike, triangles: ArrayLike, **more: Any) -> Mesh:
        """A mesh of (T, 3) triangles over (V, 3) vertices.

        Other fields are in `more`; arrays of an index per corner may be (T, 3) or flat.
        """
        triangles = np.asarray(triangles, np.int32).reshape(-1, 3)
        for name in ("corner_normals", "corner_uvs"):
            if more.get(name) is not None:
                more[name] = np.ascontiguousarray(more[name], np.int32).ravel()
        return cls(
            vertices=np.array(vertices, np.float64).reshape(-1, 3),
            corners=triangles.ravel().copy(),
            starts=np.arange(0, triangles.size + 1, 3, dtype=np.int32),
            **more,
        )
