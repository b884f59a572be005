"""The surface that is measured: triangles, and the part of the mean plane that counts."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats, cross, length, take_rows
from illumcli.errors import InputError
from illumcli.records import Record

COVERED = 1e-3
"""Part of a tile that may be missing or covered twice."""


class Surface(Record):
    """Triangles over the mean plane z = 0; z points up, away from the material."""

    vertices: Floats  # (V, 3)
    triangles: NDArray[np.int32]  # (T, 3) counter-clockwise seen from above
    low: Floats  # (2,) corner of the footprint with the least x and y
    size: Floats  # (2,) of the footprint; of a tile: its periods
    is_tile: bool  # repeated without end along x and y

    @cached_property
    def area_vectors(self) -> Floats:
        """(T, 3) normals of the triangles, as long as their areas."""
        a, b, c = (take_rows(self.vertices, corner) for corner in self.triangles.T)
        return cross(b - a, c - a) / 2

    @cached_property
    def areas(self) -> Floats:
        """(T,) areas of the triangles."""
        return length(self.area_vectors)

    @cached_property
    def normals(self) -> Floats:
        """(T, 3) unit normals; 0 for triangles without area."""
        return self.area_vectors / np.maximum(self.areas, np.finfo(np.float64).tiny)[:, None]

    @property
    def footprint(self) -> float:
        """Area of the mean plane that is measured."""
        return float(self.size[0] * self.size[1])

    @property
    def top(self) -> float:
        """Greatest height."""
        return float(self.vertices[:, 2].max())

    @property
    def depth(self) -> float:
        """Greatest height less the least."""
        return self.top - float(self.vertices[:, 2].min())

    def rms_slope(self) -> float:
        """Root mean square of the slope's tangent over the mean plane, both directions together."""
        up = self.area_vectors[:, 2]
        faces_up = up > 0
        tangent = np.hypot(*self.area_vectors[faces_up, :2].T) / up[faces_up]
        return float(np.sqrt(np.average(tangent**2, weights=up[faces_up])))


def height_field(z: Floats, period: tuple[float, float]) -> Surface:
    """The tile with heights at the points of a grid, which wraps around.

    Parameters
    ----------
    z : (rows, columns)
        Heights at y = row / rows and x = column / columns of the periods; their mean becomes 0.
    """
    rows, columns = z.shape
    x = np.arange(columns + 1) * (period[0] / columns)
    y = np.arange(rows + 1) * (period[1] / rows)
    heights = np.pad(z - z.mean(), ((0, 1), (0, 1)), mode="wrap")
    vertices = np.stack([*np.meshgrid(x, y), heights], axis=-1).reshape(-1, 3)

    # Both diagonals in turn, as in a chessboard: neither direction is preferred.
    number = np.arange(heights.size, dtype=np.int32).reshape(heights.shape)
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    odd = (np.add.outer(np.arange(rows), np.arange(columns)) % 2)[..., None] == 1
    first = np.where(odd, np.stack([a, b, d], -1), np.stack([a, b, c], -1))
    second = np.where(odd, np.stack([b, c, d], -1), np.stack([a, c, d], -1))
    triangles = np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)]).astype(np.int32)
    return Surface(vertices, triangles, np.zeros(2), np.array(period, np.float64), True)


def refuse_gaps(surface: Surface, name: str) -> None:
    """Raise InputError if a tile does not cover its mean plane once."""
    covered = float(surface.area_vectors[:, 2].sum()) / surface.footprint
    if surface.is_tile and abs(covered - 1) > COVERED:
        width, height = surface.size
        raise InputError(
            f"{name}: covers {covered:.4g} times its tile of {width:.4g} x {height:.4g}; a tile must cover "
            "it once, from edge to edge: give its --period, or none for a single piece"
        )
