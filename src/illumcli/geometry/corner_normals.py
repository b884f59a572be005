"""Normals of polygon corners: the file's own, or averages of the polygons around each vertex.

References
----------
Gouraud, H. (1971). Continuous shading of curved surfaces. IEEE Trans. Computers C-20. Equal weights.
Thürmer, G., Wüthrich, C. A. (1998). Computing vertex normals from polygonal facets. J. Graphics Tools 3.
    Angle weights.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats, Vectors, cross, dot, length, take_rows
from illumcli.geometry import polygon_normals as polygon_blocks
from illumcli.geometry.components import components
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.polygon_normals import (
    EPS,
    PolygonMethod,
    area_vectors,
    blocks,
    corner_edges,
    polygon_normals,
    polygon_of_corners,
    reversed_polygons,
    unit_file_normals,
)
from illumcli.records import Record

Weights: TypeAlias = Literal["equal", "area", "angle"]

DEFAULT_CREASE = 40.0
"""[degrees] Sharper edges of meshes without normals or smoothing groups stay sharp.

It is below the angles of intended edges: 45 (chamfers, octagons), 60 (hexagons) and 90, and 41 for a chamfer
of a cylinder of six sides, measured between its flat sides. It is above those of curved surfaces: cylinders
of nine sides and more, all but 0.5 % of the edges of scans, 1 % of a coarse model.
"""
MAX_AT_EDGE = 8
"""At an edge of more polygons than this, each is compared only with the next `MAX_AT_EDGE` - 1."""
SAME_ANGLE = 1e-9
"""Polygons that meet at exactly the crease angle are still averaged [rad]."""


class CornerNormals(Record):
    """Unit normals, and the index of each corner's. Arrays are read-only."""

    normals: Vectors  # (K, 3) float64; rows that no corner uses may be zero
    index: NDArray[np.int32]  # (C,) row of `normals`, -1 where neither vertex nor polygon has a normal
    repairs: Mapping[str, int]
    """Class of repair -> number of corners."""

    def __post_init__(self) -> None:
        self.normals.setflags(write=False)
        self.index.setflags(write=False)


def corner_normals(
    mesh: Mesh,
    weights: Weights = "angle",
    crease: float | None = None,
    use_file: bool = True,
    polygon_method: PolygonMethod = "newell",
    turned: NDArray[np.bool_] | None = None,
) -> CornerNormals:
    """The normal of every corner: the file's, or the mean of the polygons at the vertex if it has none.

    Parameters
    ----------
    weights : {"angle", "area", "equal"}
        Weight of a polygon at its vertex. Only `angle` does not depend on how faces are divided into
        polygons.
    crease : float, optional
        [degrees] Edges whose polygons meet at a larger angle are sharp. The normal of a corner is the mean of
        the polygons that can be reached around its vertex without crossing a sharp edge; from 180 on, of all.
        By default the file's smoothing groups decide, and `DEFAULT_CREASE` for polygons without a group.
    use_file : bool
        Use the file's normals. Those that are zero or not finite are computed instead, and counted.
    polygon_method : {"newell", "cross", "edge_average", "plane"}
        How the polygons' own normals are computed.
    turned : (P,) bool, optional
        Polygons that face the other side; not used with the file's normals.

    Returns
    -------
    CornerNormals
        If the polygons at a vertex cancel (two sheets back to back), a corner has its polygon's normal, and
        is counted.
    """
    if not use_file or mesh.normals is None or mesh.corner_normals is None:
        return _computed(mesh, weights, crease, polygon_method, turned)
    normals, is_valid = unit_file_normals(mesh.normals)
    has_normal = mesh.corner_normals >= 0
    is_kept = has_normal & is_valid[mesh.corner_normals]
    if is_kept.all():
        return CornerNormals(normals, mesh.corner_normals.astype(np.int32), {})

    # Computed normals, appended to the file's, for the corners that lack a valid one.
    computed = _computed(mesh, weights, crease, polygon_method, reversed_polygons(mesh))
    appended = np.where(computed.index < 0, -1, computed.index + len(normals))
    index = np.where(is_kept, mesh.corner_normals, appended).astype(np.int32)
    invalid = int(np.count_nonzero(has_normal & ~is_kept))
    repairs = {**computed.repairs, **({"zero or non-finite normals": invalid} if invalid else {})}
    return CornerNormals(np.concatenate([normals, computed.normals]), index, repairs)


def _computed(
    mesh: Mesh,
    weights: Weights,
    crease: float | None,
    method: PolygonMethod,
    turned: NDArray[np.bool_] | None = None,
) -> CornerNormals:
    """Means of polygons' normals; those of `turned` polygons, (P,), are reversed."""
    polygons = _Polygons(mesh, method, weights, turned, bool((np.diff(mesh.starts) > 3).any()))

    # A crease of 0 averages nothing.
    if crease == 0:
        normals, owner = polygons.normals, polygon_of_corners(mesh)
        is_valid = dot(normals, normals) > 0
        return CornerNormals(normals, np.where(is_valid[owner], owner, -1).astype(np.int32), {})

    # Corners that share a pool are averaged: those of a vertex, or of a vertex and smoothing group.
    pool, by_angle = (mesh.corners, None) if crease is not None else _pools(mesh)
    means, is_cancelled = _pool_means(pool, polygons)

    # Pools over which normals turn too far are split at their sharp edges.
    limit = np.radians(DEFAULT_CREASE if crease is None else crease)
    creased = _creased(pool, by_angle, means, polygons, limit) if limit < np.pi else np.zeros(0, np.intp)
    if creased.size:
        part, chosen = polygons.around(creased)
        fan = np.full(len(part.mesh.corners), -1)
        fan[chosen] = _fans_between_edges(part, chosen, limit)
        fan_means, fan_is_cancelled = _pool_means(fan, part)
        pool = pool.copy()
        pool[creased] = len(means) + fan[chosen]
        means = np.concatenate([means, fan_means])
        is_cancelled = np.concatenate([is_cancelled, fan_is_cancelled])

    # Corners whose pool cancels have their polygon's own normal.
    index, repairs = pool.astype(np.int32, copy=False), {}
    cancelled = np.flatnonzero(is_cancelled[index])
    if cancelled.size:
        part, chosen = polygons.around(cancelled)
        normals, row = part.normals, polygon_of_corners(part.mesh)[chosen]
        is_valid = dot(normals, normals)[row] > 0
        index = index.copy()
        index[cancelled] = np.where(is_valid, len(means) + row, -1)
        means = np.concatenate([means, normals])
        if count := int(np.count_nonzero(is_valid)):
            repairs["vertices whose polygons cancel"] = count
    return CornerNormals(means, index, repairs)


class _Polygons(Record):
    """Polygons of a mesh, with their normals and weights at corners."""

    mesh: Mesh
    method: PolygonMethod
    weights: Weights
    turned: NDArray[np.bool_] | None  # (P,) True for those whose normals are reversed
    has_larger: bool
    """True if the mesh has polygons of more than three corners, in these or other blocks."""

    def blocks(self) -> Iterator[tuple[slice, _Polygons]]:
        """Blocks of consecutive polygons, with the range of their corners.

        A small mesh is one block, whose normals are computed once.
        """
        if self.mesh.polygon_count <= polygon_blocks.BLOCK:
            yield slice(0, len(self.mesh.corners)), self
            return
        for polygons, corners, part in blocks(self.mesh):
            turned = None if self.turned is None else self.turned[polygons]
            yield corners, replace(self, mesh=part, turned=turned)

    def around(self, corners: NDArray[np.intp]) -> tuple[_Polygons, NDArray[np.intp]]:
        """The polygons of some corners, in their order, and the indices of these corners among theirs."""
        owner = np.searchsorted(self.mesh.starts, corners, side="right") - 1
        which, row = np.unique(owner, return_inverse=True)
        size = np.diff(self.mesh.starts)[which]
        starts = np.concatenate([[0], np.cumsum(size)]).astype(np.int32)
        shift = self.mesh.starts[which] - starts[:-1]
        every = np.arange(starts[-1]) + np.repeat(shift, size)
        part = Mesh(self.mesh.vertices, self.mesh.corners[every], starts)
        turned = None if self.turned is None else self.turned[which]
        return replace(self, mesh=part, turned=turned), corners - shift[row]

    @cached_property
    def normals(self) -> Vectors:
        """(P, 3) unit normals, on the side that counts."""
        normals = polygon_normals(self.mesh, self.method)
        return normals if self.turned is None else np.where(self.turned[:, None], -normals, normals)

    def corner_weights(self) -> Floats | float:
        """(C,) weight of each corner's polygon at the corner's vertex; 1 if all are equal."""
        if self.weights == "equal":
            return 1.0
        if self.weights == "area":
            return np.repeat(length(area_vectors(self.mesh)), np.diff(self.mesh.starts))
        following, previous = corner_edges(self.mesh)
        normal = cross(following, previous)
        angle = np.arctan2(length(normal), dot(following, previous))
        if self.has_larger:  # a reflex corner spans more than half a turn
            of_polygon = take_rows(polygon_normals(self.mesh, self.method), polygon_of_corners(self.mesh))
            angle = np.where(dot(normal, of_polygon) < 0, 2 * np.pi - angle, angle)
        return angle


def _pools(mesh: Mesh) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """The corners that are averaged together, by the file's smoothing groups.

    Returns
    -------
    pool : (C,) int
        Corners with equal numbers are averaged.
    by_angle : (C,) bool or None
        True for corners without a group, where the angle between polygons decides; None: for all corners.
    """
    if mesh.polygon_smoothing is None:
        return mesh.corners, None
    group = mesh.polygon_smoothing[polygon_of_corners(mesh)]
    known, number = np.unique(group, return_inverse=True)
    key = mesh.corners.astype(np.int64) * len(known) + number
    alone = len(mesh.vertices) * len(known) + np.arange(len(group))
    pool = np.unique(np.where(group == 0, alone, key), return_inverse=True)[1]
    return pool.ravel(), group < 0


def _pool_means(pool: NDArray[Any], polygons: _Polygons) -> tuple[Vectors, NDArray[np.bool_]]:
    """(K, 3) unit mean of the polygon normals at the corners of each pool, and (K,) where they cancel.

    `pool`, (C,), is the number of each corner's pool, -1 for corners without one.
    """
    count = int(pool.max(initial=-1)) + 1
    sums, total = np.zeros((count, 3), order="F"), np.zeros(count)
    for corners, part in polygons.blocks():
        row, owner = pool[corners].astype(np.intp), polygon_of_corners(part.mesh)
        weight = np.broadcast_to(part.corner_weights(), row.shape)
        if row.min(initial=0) < 0:
            counts = np.flatnonzero(row >= 0)
            row, owner, weight = row[counts], owner[counts], weight[counts]
        np.add.at(total, row, weight)
        for column, normal in zip(sums.T, part.normals.T, strict=True):
            np.add.at(column, row, normal[owner] * weight)
    size = length(sums)
    sums *= np.divide(1, size, out=np.zeros(count), where=size > 0)[:, None]
    return sums, size <= 16 * EPS * total


def _creased(
    pool: NDArray[Any],
    by_angle: NDArray[np.bool_] | None,
    means: Vectors,
    polygons: _Polygons,
    limit: float,
) -> NDArray[np.intp]:
    """Corners of the pools that may hold a sharp edge.

    Those are pools in which some polygon's normal is farther than half of `limit` [rad] from the mean; in the
    others any two normals are within `limit` of each other.
    """
    has_crease = np.zeros(len(means), np.bool_)
    for corners, part in polygons.blocks():
        normal = take_rows(part.normals, polygon_of_corners(part.mesh))
        difference = take_rows(means, pool[corners]) - normal
        is_far = (dot(difference, difference) > (2 * np.sin(limit / 4)) ** 2) & (dot(normal, normal) > 0)
        if by_angle is not None:
            is_far &= by_angle[corners]
        has_crease[pool[corners][is_far]] = True
    return np.flatnonzero(has_crease[pool])


def _fans_between_edges(polygons: _Polygons, corners: NDArray[Any], limit: float) -> NDArray[np.int64]:
    """(M,) a number for the fan of each of these corners, which are all corners of their vertices.

    A fan is a run of polygons around a vertex that follow each other over edges of at most `limit` [rad].
    """
    mesh, normals, owner = polygons.mesh, polygons.normals, polygon_of_corners(polygons.mesh)

    # Next and previous corner within each polygon, and each corner's place among `corners`.
    following = np.arange(1, len(mesh.corners) + 1)
    following[mesh.starts[1:] - 1] = mesh.starts[:-1]
    previous = np.empty_like(following)
    previous[following] = np.arange(len(following))
    place = np.full(len(following), -1)
    place[corners] = np.arange(len(corners))

    # The edges that end at these vertices, sorted so that those between the same two vertices are adjacent.
    ends_here = np.zeros(len(following), bool)
    ends_here[corners] = ends_here[previous[corners]] = True
    edge = np.flatnonzero(ends_here)
    ends = np.sort([mesh.corners[edge], mesh.corners[following[edge]]], axis=0)
    key = ends[0].astype(np.int64) * len(mesh.vertices) + ends[1]
    order = np.argsort(key, kind="stable")
    edge, key = edge[order], key[order]

    # Over each edge that is not sharp, join the corners of both polygons at both of its ends.
    chord = 2 * np.sin(limit / 2) + SAME_ANGLE  # angles are compared as chords, exact for small ones
    joined = [np.zeros((2, 0), np.int64)]
    for step in range(1, MAX_AT_EDGE):
        same = np.flatnonzero(key[step:] == key[:-step])
        if not same.size:
            break
        a, b = edge[same], edge[same + step]
        difference = take_rows(normals, owner[a]) - take_rows(normals, owner[b])
        is_smooth = dot(difference, difference) <= chord * chord
        a, b = a[is_smooth], b[is_smooth]
        is_opposite = mesh.corners[a] == mesh.corners[following[b]]  # as neighbours run along an edge
        start, end = np.where(is_opposite, following[b], b), np.where(is_opposite, b, following[b])
        joined += [place[[a, start]], place[[following[a], end]]]

    # Fans are the connected components.
    pairs = np.concatenate(joined, axis=1)
    first, second = pairs[:, (pairs >= 0).all(axis=0)]
    return np.unique(components(first, second, len(corners)), return_inverse=True)[1].ravel()
