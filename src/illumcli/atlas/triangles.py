"""The triangles of a mesh in the plane of a texture, in texels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats, Ids
from illumcli.records import Record, Value

STEPS = 1 << 10
"""Coordinates are rounded to so many steps per texel, as GPUs do: sums and products of them are exact."""


class TextureSize(Value):
    """Size of a texture [texels]."""

    width: int
    height: int

    @property
    def texels(self) -> int:
        """Number of all texels."""
        return self.width * self.height

    def texel(self, column: NDArray[np.int64], row: NDArray[np.int64]) -> NDArray[np.int32]:
        """Number of the texel, row by row from the top left; columns and rows outside repeat the texture."""
        return ((row % self.height) * self.width + column % self.width).astype(np.int32)


class AtlasTriangles(Record):
    """T triangles with an area in the plane of a texture, which repeats.

    x points right from the left border, y down from the top, both in texels and in whole `STEPS`. The first
    corner's tile is chosen so that the lowest coordinates of a triangle are within the texture.
    """

    size: TextureSize
    x: NDArray[np.float64]  # (3, T)
    y: NDArray[np.float64]  # (3, T)
    triangle: Ids  # (T,) the triangle of the mesh
    is_mirrored: NDArray[np.bool_]  # (T,) True where corners run clockwise in uv (with v upwards)
    without_area: int  # triangles that are left out: their uv have no area
    without_uv: int  # triangles that are left out: a corner has no uv
    tiles: int  # squares of whole numbers in uv in which triangles begin

    @property
    def double_area(self) -> NDArray[np.float64]:
        """(T,) twice the area [texels], negative where mirrored; exact."""
        x, y = self.x, self.y
        return -((x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0]))

    def weights(
        self, number: NDArray[np.int64], x: Floats, y: Floats
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Barycentric weights of corners 1 and 2 of triangles, by their number here, at (K,) points."""
        x0, y0 = self.x[0][number], self.y[0][number]
        dx, dy = x - x0, y - y0
        x1, y1 = self.x[1][number] - x0, self.y[1][number] - y0
        x2, y2 = self.x[2][number] - x0, self.y[2][number] - y0
        scale = 1 / (x1 * y2 - x2 * y1)
        return (dx * y2 - x2 * dy) * scale, (x1 * dy - dx * y1) * scale


def atlas_triangles(
    size: TextureSize, uvs: NDArray[np.floating], corner_uvs: NDArray[np.int32], triangle: Ids
) -> AtlasTriangles:
    """The triangles of a texture.

    Parameters
    ----------
    uvs : (U, 2)
        v upwards.
    corner_uvs : (K, 3) int32
        Rows of `uvs` at the corners of each triangle, -1 where a corner has none.
    triangle : (K,) int32
        Their numbers in the mesh.
    """
    # corners in whole steps, v turned downwards
    has_uv = (corner_uvs >= 0).all(axis=1)
    at = corner_uvs[has_uv].T
    u = np.rint(uvs[:, 0].astype(np.float64) * (size.width * STEPS)).take(at)
    v = np.rint((1 - uvs[:, 1].astype(np.float64)) * (size.height * STEPS)).take(at)

    # move each triangle into the texture by whole tiles
    wide, high = float(size.width * STEPS), float(size.height * STEPS)
    column, row = (
        np.floor(u.min(axis=0, initial=np.inf) / wide),
        np.floor(v.min(axis=0, initial=np.inf) / high),
    )
    u -= column * wide
    v -= row * high
    area = (u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0])
    sound = area != 0
    tiles = len(np.unique(column[sound] + 1j * row[sound]))
    return AtlasTriangles(
        size,
        u[:, sound] / STEPS,
        v[:, sound] / STEPS,
        triangle[has_uv][sound],
        area[sound] > 0,
        int((~sound).sum()),
        int((~has_uv).sum()),
        tiles,
    )
