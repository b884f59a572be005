"""The points of a bake: positions and normals from which rays are cast."""

from __future__ import annotations

from functools import cached_property
from typing import ClassVar, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, take_rows
from illumcli.baking.cells import SIZE
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry
from illumcli.geometry.spatial_order import compact
from illumcli.rays.interaction import interact
from illumcli.rays.offsets import offset_ray_origins
from illumcli.records import Record
from illumcli.visibility.hemisphere import Hemispheres

Side: TypeAlias = Literal[1, -1]
"""Of a surface: 1 outside, where its normals point, -1 inside."""


class Surfaces(Record):
    """The placed meshes of a bake and their shading normals."""

    geometry: SceneGeometry
    normals: CornerVectors  # unit shading normals of every corner


class Points(Record):
    """M points that cast rays."""

    kind: ClassVar[str] = ""
    """Tells the units of work over points of one kind from those over others."""
    cell_size: ClassVar[int] = SIZE
    """Points of a cell where values are reconstructed."""
    is_dense: ClassVar[bool] = False
    """True if w hardly differs between consecutive points of a cell: what differs is noise."""

    geometry: SceneGeometry
    n: Vectors  # (M, 3) float32 unit shading normals
    position: Vectors  # (M, 3) float32 in radii
    key: NDArray[np.uint32]  # (M,) of each point's random numbers
    objects: Ids  # (M,) object of each point
    is_flat: NDArray[np.bool_]  # (M,) True where the triangles around a point are nearly in one plane

    @cached_property
    def order(self) -> NDArray[np.int64]:
        """(M,) indices of the points in an order that keeps neighbours together."""
        return compact(self.position)

    @cached_property
    def rank(self) -> NDArray[np.int64]:
        """(M,) place of each point in that order."""
        rank = np.empty(len(self.order), np.int64)
        rank[self.order] = np.arange(len(rank))
        return rank

    def hemispheres(
        self, index: NDArray[np.int64], offset: Floats, samples: int, sampler: str, side: Side = 1
    ) -> Hemispheres:
        """Origins and axes of the rays of some points.

        Parameters
        ----------
        index : (K,) int64
            Points that are all flat, or all not.
        offset : (K,) float64
            Random, in [0, 1): shifts how each point's origins are divided among its triangles.
        samples : int
            Rays of each point.
        sampler : str
            Name of their pattern.
        side : {1, -1}
            -1 for rays into the surface, about -n, which start below it.
        """
        raise NotImplementedError

    def open_points(self, open_triangles: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(M,) True for points all of whose triangles are open.

        Parameters
        ----------
        open_triangles : (T,) bool
            True where no geometry is on that side of the triangle's plane into which rays go.
        """
        raise NotImplementedError


class PointsOnTriangles(Points):
    """M points on triangles; their rays start at one place each."""

    triangle: Ids  # (M,)
    u: Floats  # (M,) barycentric weight of corner 1
    v: Floats  # (M,) barycentric weight of corner 2

    def hemispheres(
        self, index: NDArray[np.int64], offset: Floats, samples: int, sampler: str, side: Side = 1
    ) -> Hemispheres:
        objects, triangle = self.objects[index], self.triangle[index]
        zero = np.zeros((len(index), 3), F)
        surface = interact(self.geometry, objects, triangle, self.u[index], self.v[index], zero)
        ng = F(side) * surface.ng
        origins = offset_ray_origins(surface.position, ng, surface.edge)
        return Hemispheres(F(side) * take_rows(self.n, index), origins, ng)

    def open_points(self, open_triangles: NDArray[np.bool_]) -> NDArray[np.bool_]:
        return open_triangles[self.triangle]
