"""Normals of polygon corners: the file's own, or averages of the polygons around each vertex.

References
----------
Gouraud, H. (1971). Continuous shading of curved surfaces. IEEE Trans. Computers C-20. Equal weights.
Thürmer, G., Wüthrich, C. A. (1998). Computing vertex normals from polygonal facets. J. Graphics Tools 3.
    Angle weights.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats, Vectors, cross, dot, length, take_rows, unit
from illumcli.geometry.components import components
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.polygon_normals import (
    EPS,
    PolygonMethod,
    area_vectors,
    corner_edges,
    polygon_normals,
    reversed_polygons,
    unit_file_normals,
)
from illumcli.records import Record

Weights: TypeAlias = Literal["equal", "area", "angle"]

DEFAULT_CREASE = 40.0
"""[degrees] Sharper edges of meshes without normals or smoothing groups stay sharp.

Below the edges that parts are made with on purpose, 45 (chamfers, octagons), 60 (hexagons) and 90, also
where a chamfer of a coarse cylinder is measured between its flat sides (41 for six sides); above those of
curved surfaces: cylinders of nine sides and more, all but 0.5 % of the edges of scans, 1 % of a coarse model.
"""
MAX_AT_EDGE = 8
"""Polygons that meet at one edge: each is compared with at most so many, less 1, that follow it."""
SAME_ANGLE = 1e-9
"""Polygons that meet at exactly the crease angle are still averaged [rad]."""


class CornerNormals(Record):
    """Unit normals and which of them each corner has. Arrays are read-only."""

    normals: Vectors  # (K, 3) float64; rows that no corner uses may be zero
    index: NDArray[np.int32]  # (C,) row of `normals`, -1 where neither vertex nor polygon has a normal
    repairs: Mapping[str, int]
    """What was wrong and was repaired: class -> number of corners."""

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
    """The normal of every corner: the file's own where it has one, or the mean of the polygons at the vertex.

    Parameters
    ----------
    weights : {"angle", "area", "equal"}
        How much a polygon counts at its vertex. Only `angle` does not depend on how faces are cut into
        polygons.
    crease : float, optional
        [degrees] Edges whose polygons meet at more than this are sharp. A corner averages the polygons that
        can be reached around its vertex from its own without crossing a sharp edge; from 180 on all of them.
        By default the file's smoothing groups decide, and `DEFAULT_CREASE` for polygons without any.
    use_file : bool
        Use the file's normals. Those that are zero or not finite are computed instead, and counted.
    polygon_method : {"newell", "cross", "edge_average", "plane"}
        How the polygons' own normals are computed.
    turned : (P,) bool, optional
        Polygons that are seen from their other side, where the file's normals are not used.

    Returns
    -------
    CornerNormals
        Where the polygons at a vertex cancel (two sheets back to back) a corner has its polygon's normal;
        counted.
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
    """Normals averaged from those of polygons; those that are `turned`, (P,), count with their other side."""
    # Normals and weights of the polygons; a crease of 0 averages nothing.
    polygons = polygon_normals(mesh, method)
    weight = _corner_weights(mesh, weights, polygons)
    if turned is not None:
        polygons = np.where(turned[:, None], -polygons, polygons)
    owner = np.repeat(np.arange(mesh.polygon_count, dtype=np.int32), np.diff(mesh.starts))
    if crease == 0:
        is_valid = dot(polygons, polygons) > 0
        return CornerNormals(polygons, np.where(is_valid[owner], owner, -1).astype(np.int32), {})

    # Corners that share a pool are averaged: those of a vertex, or of a vertex and smoothing group.
    pool, by_angle = (mesh.corners, None) if crease is not None else _pools(mesh, owner)
    sums, total = _pool_sums(pool, weight, polygons, owner)

    # Pools over which normals turn too far are split at their sharp edges.
    limit = np.radians(DEFAULT_CREASE if crease is None else crease)
    creased = _creased(pool, by_angle, take_rows(polygons, owner), sums, limit) if limit < np.pi else pool[:0]
    if creased.size:
        fan = _fans_between_edges(mesh, creased, polygons, owner, limit)
        fan_weight = None if weight is None else weight[creased]
        fan_sums, fan_total = _pool_sums(fan, fan_weight, polygons, owner[creased])
        pool = pool.copy()
        pool[creased] = len(sums) + fan
        sums, total = np.concatenate([sums, fan_sums]), np.concatenate([total, fan_total])
    return _without_cancelled(sums, total, pool.astype(np.int32), polygons, owner)


def _without_cancelled(
    sums: Vectors, total: Floats, index: NDArray[np.int32], polygons: Vectors, owner: NDArray[np.int32]
) -> CornerNormals:
    """The sums made unit; corners whose sum cancels get their polygon's own normal."""
    is_cancelled = length(sums) <= 16 * EPS * total
    cancelled = np.flatnonzero(is_cancelled[index])
    if not len(cancelled):
        return CornerNormals(unit(sums), index.astype(np.int32), {})
    replacing, row = np.unique(owner[cancelled], return_inverse=True)
    normals = take_rows(polygons, replacing)
    is_valid = dot(normals, normals)[row] > 0
    index = index.copy()
    index[cancelled] = np.where(is_valid, len(sums) + row, -1)
    count = int(np.count_nonzero(is_valid))
    repairs = {"vertices whose polygons cancel": count} if count else {}
    return CornerNormals(np.concatenate([unit(sums), normals]), index.astype(np.int32), repairs)


def _corner_weights(mesh: Mesh, weights: Weights, polygons: Vectors) -> Floats | None:
    """(C,) weight of each corner's polygon at the corner's vertex; None if all are equal."""
    size = np.diff(mesh.starts)
    if weights == "equal":
        return None
    if weights == "area":
        return np.repeat(length(area_vectors(mesh)), size)
    following, previous = corner_edges(mesh)
    normal = cross(following, previous)
    angle = np.arctan2(length(normal), dot(following, previous))
    if mesh.polygon_count and size.max() > 3:  # a reflex corner spans more than half a turn
        is_reflex = dot(normal, take_rows(polygons, np.repeat(np.arange(len(size)), size))) < 0
        angle = np.where(is_reflex, 2 * np.pi - angle, angle)
    return angle


def _pools(mesh: Mesh, owner: NDArray[np.int32]) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """Which corners are averaged together, by the file's smoothing groups.

    Returns
    -------
    pool : (C,) int
        Corners of equal numbers are averaged.
    by_angle : (C,) bool or None
        True where the angle between polygons decides too, because the file has no group; None: everywhere.
    """
    if mesh.polygon_smoothing is None:
        return mesh.corners, None
    group = mesh.polygon_smoothing[owner]
    known, number = np.unique(group, return_inverse=True)
    key = mesh.corners.astype(np.int64) * len(known) + number
    alone = len(mesh.vertices) * len(known) + np.arange(len(group))
    pool = np.unique(np.where(group == 0, alone, key), return_inverse=True)[1]
    return pool.ravel(), group < 0


def _pool_sums(
    pool: NDArray[Any], weight: Floats | None, polygons: Vectors, owner: NDArray[np.int32]
) -> tuple[Vectors, Floats]:
    """(K, 3) weighted sums of the polygon normals at the corners of each pool, and (K,) of the weights."""
    total = np.bincount(pool, weight).astype(np.float64)
    sums = np.empty((len(total), 3), order="F")
    for axis in range(3):
        part = polygons[:, axis][owner]
        sums[:, axis] = np.bincount(pool, part if weight is None else part * weight)
    return sums, total


def _creased(
    pool: NDArray[Any],
    by_angle: NDArray[np.bool_] | None,
    normal: Vectors,
    sums: Vectors,
    limit: float,
) -> NDArray[np.intp]:
    """Corners of the pools that may hold a sharp edge.

    Those are pools in which some polygon's normal, (C, 3), is farther than half of `limit` [rad] from the
    mean; in the others any two normals are within `limit` of each other.
    """
    difference = take_rows(unit(sums), pool) - normal
    is_far = (dot(difference, difference) > (2 * np.sin(limit / 4)) ** 2) & (dot(normal, normal) > 0)
    if by_angle is not None:
        is_far &= by_angle
    has_crease = np.zeros(len(sums), np.bool_)
    has_crease[pool[is_far]] = True
    return np.flatnonzero(has_crease[pool])


def _fans_between_edges(
    mesh: Mesh, corners: NDArray[Any], polygons: Vectors, owner: NDArray[np.int32], limit: float
) -> NDArray[np.int64]:
    """(M,) a number for the fan of each of these corners, which are all corners of their vertices.

    A fan is a run of polygons around a vertex that follow each other over edges of at most `limit` [rad].
    """
    # Next and previous corner within each polygon, and each corner's place among `corners`.
    following = np.arange(1, len(mesh.corners) + 1)
    following[mesh.starts[1:] - 1] = mesh.starts[:-1]
    previous = np.empty_like(following)
    previous[following] = np.arange(len(following))
    place = np.full(len(following), -1)
    place[corners] = np.arange(len(corners))

    # The edges that end at these vertices, sorted so that those between the same two vertices are adjacent.
    edge = np.unique(np.concatenate([corners, previous[corners]]))
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
        difference = take_rows(polygons, owner[a]) - take_rows(polygons, owner[b])
        is_smooth = dot(difference, difference) <= chord * chord
        a, b = a[is_smooth], b[is_smooth]
        is_opposite = mesh.corners[a] == mesh.corners[following[b]]  # as neighbours run along an edge
        start, end = np.where(is_opposite, following[b], b), np.where(is_opposite, b, following[b])
        joined += [place[[a, start]], place[[following[a], end]]]

    # Fans are the connected components.
    pairs = np.concatenate(joined, axis=1)
    first, second = pairs[:, (pairs >= 0).all(axis=0)]
    return np.unique(components(first, second, len(corners)), return_inverse=True)[1].ravel()
