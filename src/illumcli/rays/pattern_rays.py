"""Rays of points that each cast a pattern of directions, turned into a frame of the point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Vectors, dot, take_rows
from illumcli.records import Record


class CompactTable(Record):
    """The columns of a table of patterns in an order that keeps like directions together."""

    table: NDArray[np.float32]  # (R, 3, N)
    number: NDArray[np.int32]  # (N,) number of each column in the original table


class Patterns(Record):
    """The pattern of each of M points: unit directions about +z, N each."""

    table: NDArray[np.float32]  # (R, 3, N)
    row: NDArray[np.int32]  # (M,) pattern of each point
    compact: CompactTable | None = None  # packets of rays with like directions are traced faster


class PatternRays(Record):
    """Rays of M points, N each: ray i of a point has the direction of column i of the point's pattern.

    A direction (x, y, z) of a pattern becomes x tangent + y bitangent + z normal of the point's frame. If it
    points below the triangle that the ray leaves, it is mirrored at the triangle's plane.
    """

    patterns: Patterns
    frames: NDArray[np.float32]  # (M, 3, 3) rows tangent, bitangent, normal
    origins: Vectors  # (M * E, 3) float32; those of a point follow each other
    origin_of_ray: NDArray[np.int32]  # (N,) which of its point's origins a ray starts from
    normals: Vectors | None  # (M * E, 3) float32 of the triangles that the rays leave; None: none is mirrored
    first_mirrored: NDArray[np.int32]  # (M,) rays with a lower number are known to point above the triangle
    least_height: float  # of a mirrored direction above its triangle

    @property
    def shape(self) -> tuple[int, int]:
        """(M, N)."""
        return len(self.frames), self.patterns.table.shape[2]

    @property
    def origins_per_point(self) -> int:
        """E."""
        return len(self.origins) // max(len(self.frames), 1)

    def between(self, first: int, end: int) -> PatternRays:
        """The rays of points `first` to `end`, as views of these arrays."""
        points, each = slice(first, end), self.origins_per_point
        origins = slice(first * each, end * each)
        return PatternRays(
            Patterns(self.patterns.table, self.patterns.row[points], self.patterns.compact),
            self.frames[points],
            self.origins[origins],
            self.origin_of_ray,
            None if self.normals is None else self.normals[origins],
            self.first_mirrored[points],
            self.least_height,
        )

    def starts(self) -> Vectors:
        """(M, 3) the origin of each point, or (M * N, 3) of each ray, one point after the other."""
        each = self.origins_per_point
        if each <= 1:
            return self.origins
        points = np.arange(len(self.frames))[:, None]
        return take_rows(self.origins, (points * each + self.origin_of_ray).ravel())

    def directions(self) -> Vectors:
        """(M * N, 3) float32 directions, one point after the other; each product and sum is rounded."""
        pattern = self.patterns.table.take(self.patterns.row, axis=0)
        d, term = np.empty((3, *self.shape), F), np.empty(self.shape, F)
        for component, column in zip(d, self.frames.transpose(2, 1, 0), strict=True):
            np.multiply(column[0, :, None], pattern[:, 0], out=component)
            component += np.multiply(column[1, :, None], pattern[:, 1], out=term)
            component += np.multiply(column[2, :, None], pattern[:, 2], out=term)
        directions = d.reshape(3, -1).T
        if self.normals is not None:
            self._mirror(directions, self.normals)
        return directions

    def _mirror(self, d: Vectors, normals: Vectors) -> None:
        """Mirror those of the directions that point below the triangle that their ray leaves, in place."""
        # The candidates, counted from the last ray of each point.
        samples = self.shape[1]
        number = samples - self.first_mirrored
        point = np.repeat(np.arange(len(number)), number)
        from_last = np.arange(len(point)) - np.repeat(np.cumsum(number) - number, number)
        ray_of_point = samples - 1 - from_last
        ray = point * samples + ray_of_point
        origin = point * self.origins_per_point + self.origin_of_ray[ray_of_point]

        # Reflect those that do point below.
        normal = take_rows(normals, origin)
        height = dot(take_rows(d, ray), normal)
        below = np.flatnonzero(height < F(self.least_height))
        height, ray = height[below], ray[below]
        up = np.maximum(-height, F(self.least_height)) - height
        for component, along in zip(d.T, take_rows(normal, below).T, strict=True):
            component[ray] += up * along


class PatternResults(Record):
    """Room for the results of M points with N rays each; of a point, in the order of its rays' numbers."""

    open: NDArray[np.int32]  # (M,) number of rays that are not occluded
    is_open: NDArray[np.bool_] | None = None  # (M, N)
    distance: NDArray[np.float32] | None = None
    """(M, N) distance of each ray's closest hit. If it is wanted, `open` and `is_open` mean nothing."""
    directions: NDArray[np.float32] | None = None  # (3, M, N)

    @classmethod
    def room(cls, shape: tuple[int, int], *wanted: str) -> PatternResults:
        """Uninitialized arrays for what is wanted beside `open`."""
        return cls(
            np.zeros(shape[0], np.int32),
            np.empty(shape, np.bool_) if "is_open" in wanted else None,
            np.empty(shape, F) if "distance" in wanted else None,
            np.empty((3, *shape), F) if "directions" in wanted else None,
        )
