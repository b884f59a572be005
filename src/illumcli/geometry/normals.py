"""Normals of polygons, and of their corners from the polygons around each vertex.

All work is in float64 on the corners of ragged polygons at once; a single polygon is the case of one. Sums
stand on vectors from the polygon's first corner, so a mesh far from the origin keeps its digits. Every
polygon has at least three corners.

References
----------
Gouraud, H. (1971). Continuous shading of curved surfaces. IEEE Trans. Computers C-20. Equal weights.
Sutherland, I. E., Sproull, R. F., Schumacker, R. A. (1974). A characterization of ten hidden-surface
    algorithms. ACM Computing Surveys 6. The Martin-Newell normal.
Thürmer, G., Wüthrich, C. A. (1998). Computing vertex normals from polygonal facets. J. Graphics Tools 3.
    Angle weights.
Theoharis, T. et al. (2008). Graphics and Visualization, eq. 12.31 to 12.33.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from illumcli.arrays import Floats, Vectors, cross, dot, length, take_rows, unit
from illumcli.geometry.components import components
from illumcli.geometry.mesh import Mesh
from illumcli.records import Record

PolygonMethod: TypeAlias = Literal["cross", "edge_average", "newell", "plane"]
Weights: TypeAlias = Literal["equal", "area", "angle"]

EPS = np.finfo(np.float64).eps
AGAINST = -0.01  # cosine below which a normal lies clearly on the other side of its polygon
DEFAULT_CREASE = 40.0
"""[degrees] Sharper edges of meshes without normals or smoothing groups stay sharp.

Below the edges that parts are made with on purpose, 45 (chamfers, octagons), 60 (hexagons) and 90, also
where a chamfer of a coarse cylinder is measured between its flat sides (41 for six sides); above those of
curved surfaces: cylinders of nine sides and more, all but 0.5 % of the edges of scans, 1 % of a coarse model.
"""
MOST_AT_EDGE = 8  # polygons that meet at one edge are compared with so many that follow, less 1
SAME_ANGLE = 1e-9  # [rad] polygons that meet at exactly the crease angle are still averaged


class CornerNormals(Record):
    """Unit normals and which of them each corner has. Arrays are read-only."""

    normals: Vectors  # (K, 3) float64; rows that no corner names may be zero
    index: NDArray[np.int32]  # (C,) row of `normals`, -1 where neither vertex nor polygon has a normal
    repairs: Mapping[str, int]
    """What was wrong and put right: class -> corners."""

    def __post_init__(self) -> None:
        self.normals.setflags(write=False)
        self.index.setflags(write=False)


def polygon_normals(mesh: Mesh, method: PolygonMethod = "newell") -> Vectors:
    """(P, 3) float64 unit normals, on the side from which the polygon runs counter-clockwise.

    Parameters
    ----------
    method : {"newell", "cross", "edge_average", "plane"}
        `newell` suits every polygon. The others are the textbook ones: `cross` of the edges at the first
        corner (turned round where that corner is reflex), `edge_average` of the unit cross products at all
        corners, `plane` through the first three corners, on Newell's side. Where one of these finds nothing
        (corners on a line) Newell's stands in.

    Returns
    -------
    (P, 3) float64; zero for degenerate polygons: all corners on a line, as far as doubles tell.
    """
    newell = unit(area_vectors(mesh))
    if method == "newell":
        return newell
    first = mesh.starts[:-1]
    if method == "cross":
        normals = unit(take_rows(corner_crosses(mesh), first))
    elif method == "edge_average":
        normals = unit(_per_polygon(unit(corner_crosses(mesh)), mesh.starts))
    else:
        a, b, fans = _fans(mesh)
        normals = unit(cross(take_rows(a, fans[:-1]), take_rows(b, fans[:-1])))
        normals = normals * np.where(dot(normals, newell) < 0, -1.0, 1.0)[:, None]
    found = dot(normals, normals) > 0
    return np.where((found & (dot(newell, newell) > 0))[:, None], normals, newell)


def reversed_polygons(mesh: Mesh) -> NDArray[np.bool_] | None:
    """(P,) True for polygons that run clockwise seen from where the file's normals point; None if none does.

    At every corner the normal and the polygon's own make a cosine below `AGAINST`. A polygon of which some
    normals lie on either side, as a card of foliage has them, keeps its side, and so does one that lacks
    normals.
    """
    if mesh.normals is None or mesh.corner_normals is None or not mesh.polygon_count:
        return None
    own, good = _file_normals(mesh.normals)
    polygon = np.repeat(np.arange(mesh.polygon_count, dtype=np.int32), np.diff(mesh.starts))
    cosine = dot(take_rows(own, mesh.corner_normals), take_rows(polygon_normals(mesh), polygon))
    against = (cosine < AGAINST) & (mesh.corner_normals >= 0) & good[mesh.corner_normals]
    found: NDArray[np.bool_] = np.logical_and.reduceat(against, mesh.starts[:-1])
    return found if found.any() else None


def area_vectors(mesh: Mesh) -> Vectors:
    """(P, 3) Newell's vectors, twice the polygons' area along their normals; zero for degenerate polygons.

    The sum of the cross products of the fan from the first corner, which is Newell's sum with that corner as
    the origin. Also right for concave polygons.
    """
    a, b, fans = _fans(mesh)
    vectors = _per_polygon(cross(a, b), fans)
    noise = 4 * EPS * _per_polygon(dot(a, a) + dot(b, b), fans)
    return vectors * (length(vectors) > noise)[:, None]


def corner_crosses(mesh: Mesh) -> Vectors:
    """(C, 3) cross product of the edges that leave each corner, next x previous, not normalised.

    Outward at a convex corner of a counter-clockwise polygon, the other way at a reflex one.
    """
    following, previous = _corner_edges(mesh)
    return cross(following, previous)


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
        What a polygon counts at its vertex. Only `angle` does not depend on how faces are cut into polygons.
    crease : float, optional
        [degrees] Edges whose polygons meet at more than this are sharp. A corner averages the polygons around
        its vertex that follow each other from its own without a sharp edge between; from 180 on all of them.
        By default the file's smoothing groups say which are averaged, and, for polygons of which the file
        says nothing, `DEFAULT_CREASE`.
    use_file : bool
        Take the file's normals. Those that are zero or not finite are computed instead, and counted.
    polygon_method : {"newell", "cross", "edge_average", "plane"}
        How the polygons' own normals are made.
    turned : (P,) bool, optional
        Polygons that are seen from their other side, where the file's normals are not taken.

    Returns
    -------
    CornerNormals
        Where the polygons at a vertex cancel (two sheets back to back) a corner has its polygon's normal;
        counted.
    """
    if not use_file or mesh.normals is None or mesh.corner_normals is None:
        return _computed(mesh, weights, crease, polygon_method, turned)
    own, good = _file_normals(mesh.normals)
    named = mesh.corner_normals >= 0
    kept = named & good[mesh.corner_normals]
    if kept.all():
        return CornerNormals(own, mesh.corner_normals.astype(np.int32), {})
    made = _computed(mesh, weights, crease, polygon_method, reversed_polygons(mesh))
    index = np.where(kept, mesh.corner_normals, np.where(made.index < 0, -1, made.index + len(own)))
    bad = int(np.count_nonzero(named & ~kept))
    repairs = {**made.repairs, **({"zero or non-finite normals": bad} if bad else {})}
    return CornerNormals(np.concatenate([own, made.normals]), index.astype(np.int32), repairs)


# One polygon or one vertex: the case of one


def cross_normal(vertices: ArrayLike, index: int) -> NDArray[np.float64]:
    """(3,) cross product at one vertex of a polygon, (v[i+1] - v[i]) x (v[i-1] - v[i]); not normalised."""
    return corner_crosses(_single(vertices))[index]


def edge_average_normal(vertices: ArrayLike) -> NDArray[np.float64]:
    """(3,) unit mean of the unit cross products at all vertices of a polygon."""
    return polygon_normals(_single(vertices), "edge_average")[0]


def newell_plane(vertices: ArrayLike) -> NDArray[np.float64]:
    """(4,) [a, b, c, d] of the plane a x + b y + c z + d = 0 by Martin-Newell, through the first vertex.

    (a, b, c) is twice the polygon's area vector.
    """
    normal = area_vectors(_single(vertices))[0]
    return np.append(normal, -normal @ np.asarray(vertices, np.float64)[0])


def plane_solve(p1: ArrayLike, p2: ArrayLike, p3: ArrayLike) -> NDArray[np.float64]:
    """(3,) the solution of p_i . (a, b, c) = -1 for three points, formed as -N / (N . p1).

    Its length is 1 / (distance of the plane from the origin); it points to the origin's side whatever the
    winding. Not finite where the plane meets the origin or the points lie on a line.
    """
    normal = corner_crosses(_single(np.stack([p1, p2, p3])))[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return -normal / (normal @ np.asarray(p1, np.float64))


def vertex_normal(
    vertex: ArrayLike, ring: ArrayLike, closed: bool, weighting: Weights
) -> NDArray[np.float64]:
    """(3,) unit normal of a vertex amid a ring of triangles (vertex, ring[i], ring[i + 1]).

    Parameters
    ----------
    ring : (k, 3) float
        Neighbours in counter-clockwise order.
    closed : bool
        Whether a triangle joins the last neighbour to the first.
    """
    around = np.asarray(ring, np.float64)
    first = np.arange(1, len(around) + 1)
    second = np.roll(first, -1)
    triangles = np.stack([np.zeros_like(first), first, second], axis=1)[: len(around) if closed else -1]
    mesh = Mesh.of_triangles(np.vstack([np.asarray(vertex, np.float64), around]), triangles)
    made = corner_normals(mesh, weighting, crease=180.0, use_file=False)
    return made.normals[made.index[0]]


# How it is done


def _single(vertices: ArrayLike) -> Mesh:
    points = np.array(vertices, np.float64)
    count = len(points)
    return Mesh(points, np.arange(count, dtype=np.int32), np.array([0, count], np.int32))


def _corner_points(mesh: Mesh) -> NDArray[np.float64]:
    """(C, 3) where each corner is, components contiguous."""
    return take_rows(np.asfortranarray(mesh.vertices), mesh.corners)


def _ends(mesh: Mesh) -> tuple[Any, Any]:
    """Index of the first and of the last corner of every polygon; slices where all have as many corners."""
    size = np.diff(mesh.starts)
    if len(size) and (size == size[0]).all():
        return slice(0, None, int(size[0])), slice(int(size[0]) - 1, None, int(size[0]))
    return mesh.starts[:-1], mesh.starts[1:] - 1


def _corner_edges(mesh: Mesh) -> tuple[Vectors, Vectors]:
    """(C, 3) from each corner to the next, and to the previous one, of its polygon."""
    points = _corner_points(mesh)
    first, last = _ends(mesh)
    following, previous = np.empty_like(points), np.empty_like(points)
    for p, ahead, back in zip(points.T, following.T, previous.T, strict=True):
        np.subtract(p[1:], p[:-1], out=ahead[:-1])
        ahead[last] = p[first] - p[last]
        np.negative(ahead[:-1], out=back[1:])
        back[first] = -ahead[last]
    return following, previous


def _fans(mesh: Mesh) -> tuple[Vectors, Vectors, NDArray[Any]]:
    """(F, 3) both edges of each fan triangle from its first corner, and (P + 1,) where the fans start."""
    count = np.maximum(np.diff(mesh.starts) - 2, 0)
    fans = np.concatenate([[0], np.cumsum(count)])
    if (count == 1).all():
        vertices = np.asfortranarray(mesh.vertices)
        origin, second, third = (take_rows(vertices, mesh.corners[k::3]) for k in range(3))
    else:
        points = _corner_points(mesh)
        at = np.arange(fans[-1]) - np.repeat(fans[:-1] - mesh.starts[:-1] - 1, count)
        origin, second, third = (
            take_rows(points, np.repeat(mesh.starts[:-1], count)),
            take_rows(points, at),
            take_rows(points, at + 1),
        )
    return second - origin, third - origin, fans


def _per_polygon(values: NDArray[Any], starts: NDArray[Any]) -> NDArray[Any]:
    """(P, ...) sums of the values between successive `starts`; 0 where there are none."""
    if len(values) == len(starts) - 1 and (np.diff(starts) == 1).all():
        return values
    out = np.zeros((len(starts) - 1, *values.shape[1:]), values.dtype, order="F")
    some = np.diff(starts) > 0
    if some.any():
        out[some] = np.add.reduceat(values, starts[:-1][some], axis=0)
    return out


def _file_normals(normals: NDArray[np.float64]) -> tuple[Vectors, NDArray[np.bool_]]:
    """The file's normals made unit, and which of them are directions at all."""
    largest = np.abs(normals).max(axis=1, initial=0.0)
    good = (largest > 0) & np.isfinite(largest)
    scaled = np.zeros_like(normals, order="F")
    np.divide(normals, largest[:, None], out=scaled, where=good[:, None])
    return unit(scaled), good


def _computed(
    mesh: Mesh,
    weights: Weights,
    crease: float | None,
    method: PolygonMethod,
    turned: NDArray[np.bool_] | None = None,
) -> CornerNormals:
    """Normals made from polygons, those that are `turned`, (P,), with their other side."""
    polygons = polygon_normals(mesh, method)
    weight = _corner_weights(mesh, weights, polygons)
    if turned is not None:
        polygons = np.where(turned[:, None], -polygons, polygons)
    owner = np.repeat(np.arange(mesh.polygon_count, dtype=np.int32), np.diff(mesh.starts))
    if crease == 0:
        sound = dot(polygons, polygons) > 0
        return CornerNormals(polygons, np.where(sound[owner], owner, -1).astype(np.int32), {})

    # Corners that share a pool are averaged: those of a vertex, or of a vertex and smoothing group.
    pool, by_angle = (mesh.corners, None) if crease is not None else _pools(mesh, owner)
    sums, total = _sums(pool, weight, polygons, owner)

    # Pools over which normals turn too far are split at their sharp edges.
    limit = np.radians(DEFAULT_CREASE if crease is None else crease)
    wide = _wide(pool, by_angle, take_rows(polygons, owner), sums, limit) if limit < np.pi else pool[:0]
    if wide.size:
        fan = _fans_between_edges(mesh, wide, polygons, owner, limit)
        parts = _sums(fan, None if weight is None else weight[wide], polygons, owner[wide])
        pool = pool.copy()
        pool[wide] = len(sums) + fan
        sums, total = np.concatenate([sums, parts[0]]), np.concatenate([total, parts[1]])
    return _with_polygons_own(sums, total, pool.astype(np.int32), polygons, owner)


def _with_polygons_own(
    sums: Vectors, total: Floats, index: NDArray[np.int32], polygons: Vectors, owner: NDArray[np.int32]
) -> CornerNormals:
    """The sums made unit; corners whose sum cancels have their polygon's own normal."""
    cancelled = length(sums) <= 16 * EPS * total
    lost = np.flatnonzero(cancelled[index])
    if not len(lost):
        return CornerNormals(unit(sums), index.astype(np.int32), {})
    replaced, row = np.unique(owner[lost], return_inverse=True)
    own = take_rows(polygons, replaced)
    some = dot(own, own)[row] > 0
    index = index.copy()
    index[lost] = np.where(some, len(sums) + row, -1)
    count = int(np.count_nonzero(some))
    repairs = {"vertices whose polygons cancel": count} if count else {}
    return CornerNormals(np.concatenate([unit(sums), own]), index.astype(np.int32), repairs)


def _corner_weights(mesh: Mesh, weights: Weights, polygons: Vectors) -> Floats | None:
    """(C,) what each corner's polygon counts at the corner's vertex; None for all the same."""
    size = np.diff(mesh.starts)
    if weights == "equal":
        return None
    if weights == "area":
        return np.repeat(length(area_vectors(mesh)), size)
    following, previous = _corner_edges(mesh)
    normal = cross(following, previous)
    angle = np.arctan2(length(normal), dot(following, previous))
    if mesh.polygon_count and size.max() > 3:  # a reflex corner spans more than half a turn
        reflex = dot(normal, take_rows(polygons, np.repeat(np.arange(len(size)), size))) < 0
        angle = np.where(reflex, 2 * np.pi - angle, angle)
    return angle


def _pools(mesh: Mesh, owner: NDArray[np.int32]) -> tuple[NDArray[Any], NDArray[np.bool_] | None]:
    """(C,) which corners are averaged together, by the file's smoothing groups, and (C,) where the angle
    between polygons decides too: where the file says nothing. None: everywhere."""
    if mesh.polygon_smoothing is None:
        return mesh.corners, None
    group = mesh.polygon_smoothing[owner]
    known, number = np.unique(group, return_inverse=True)
    key = mesh.corners.astype(np.int64) * len(known) + number
    alone = len(mesh.vertices) * len(known) + np.arange(len(group))
    pool = np.unique(np.where(group == 0, alone, key), return_inverse=True)[1]
    return pool.ravel(), group < 0


def _sums(
    pool: NDArray[Any], weight: Floats | None, polygons: Vectors, owner: NDArray[np.int32]
) -> tuple[Vectors, Floats]:
    """(K, 3) weighted sums of the polygon normals at the corners of each pool, and (K,) of the weights."""
    total = np.bincount(pool, weight).astype(np.float64)
    sums = np.empty((len(total), 3), order="F")
    for axis in range(3):
        part = polygons[:, axis][owner]
        sums[:, axis] = np.bincount(pool, part if weight is None else part * weight)
    return sums, total


def _wide(
    pool: NDArray[Any],
    by_angle: NDArray[np.bool_] | None,
    normal: Vectors,
    sums: Vectors,
    limit: float,
) -> NDArray[np.intp]:
    """Corners of the pools that may hold a sharp edge: of those where a polygon stands farther than half of
    `limit` [rad] from the mean; any two others stand within it."""
    apart = take_rows(unit(sums), pool) - normal
    far = (dot(apart, apart) > (2 * np.sin(limit / 4)) ** 2) & (dot(normal, normal) > 0)
    if by_angle is not None:
        far &= by_angle
    is_wide = np.zeros(len(sums), np.bool_)
    is_wide[pool[far]] = True
    return np.flatnonzero(is_wide[pool])


def _fans_between_edges(
    mesh: Mesh, corners: NDArray[Any], polygons: Vectors, owner: NDArray[np.int32], limit: float
) -> NDArray[np.int64]:
    """(M,) a number for the fan of each of these corners, which are all that their vertices have: polygons
    around a vertex that follow each other over edges of at most `limit` [rad]."""
    following = np.arange(1, len(mesh.corners) + 1)
    following[mesh.starts[1:] - 1] = mesh.starts[:-1]
    previous = np.empty_like(following)
    previous[following] = np.arange(len(following))
    place = np.full(len(following), -1)
    place[corners] = np.arange(len(corners))

    # The edges that end at these vertices, so ordered that those between the same two vertices follow each
    # other: each is compared with some that come after it.
    edge = np.unique(np.concatenate([corners, previous[corners]]))
    ends = np.sort([mesh.corners[edge], mesh.corners[following[edge]]], axis=0)
    key = ends[0].astype(np.int64) * len(mesh.vertices) + ends[1]
    order = np.argsort(key, kind="stable")
    edge, key = edge[order], key[order]
    near = 2 * np.sin(limit / 2) + SAME_ANGLE  # compared as a chord, exact for small angles
    joints = [np.zeros((2, 0), np.int64)]
    for step in range(1, MOST_AT_EDGE):
        same = np.flatnonzero(key[step:] == key[:-step])
        if not same.size:
            break
        a, b = edge[same], edge[same + step]
        apart = take_rows(polygons, owner[a]) - take_rows(polygons, owner[b])
        soft = dot(apart, apart) <= near * near
        a, b = a[soft], b[soft]
        against = mesh.corners[a] == mesh.corners[following[b]]  # as neighbours run along an edge
        start, end = np.where(against, following[b], b), np.where(against, b, following[b])
        joints += [place[[a, start]], place[[following[a], end]]]
    joint = np.concatenate(joints, axis=1)
    first, second = joint[:, (joint >= 0).all(axis=0)]
    return np.unique(components(first, second, len(corners)), return_inverse=True)[1].ravel()
