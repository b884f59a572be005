"""Points with no geometry above their tangent plane: obscurance is 1 there, so no rays are cast.

A point is open when every vertex of the occluders lies below its tangent plane. The vertices are kept in a
tree of clusters with `FANOUT` children each. A cluster is bounded by a disc-shaped slab along its best-fit
plane; on a smooth surface the slab's height falls with the square of its radius. Points are tested in groups
of neighbours, so that on a convex surface a group visits some hundreds of clusters, however fine the mesh is.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Ids, Vectors, column_major, dot
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.geometry.spatial_order import compact
from illumcli.rays.interaction import Hits, SurfaceInteraction, facing, interact
from illumcli.rays.offsets import ORIGIN_OFFSET
from illumcli.records import Record

FANOUT = 8
"""Points per cluster of the finest level, and clusters per cluster of the next level."""
GROUP = 64
"""Neighbouring points that are tested together."""
GROUPS_AT_ONCE = 64
TRIAL_STEP = 16
"""One group in this many is tested first; if no point of it is open, its neighbours cast rays untested."""
MAX_CLUSTERS = 1 << 13
"""Groups that would visit more clusters than this cast rays instead."""
MIN_CANDIDATES = 1 / 64
"""Share of the points that must pass the cheap tests for the tree to be used; building the tree takes as long
as a few rays from every vertex."""
DIRECTIONS = 64
"""Directions whose extreme vertices are compared with every plane first."""
TRIAL_GROUPS = 64
"""Groups of triangles, both sides together, that decide whether the others are tested."""
CLEARANCE = 1e-5
"""Height above a plane below which the cheap tests, in single precision, decide nothing [radii]."""
BOUND_ROUNDING = 1e-12
"""Enlargement of slabs, so that bounds hold in spite of rounding [radii]."""

PlanesAt: TypeAlias = Callable[[NDArray[np.int64]], tuple[Vectors, Vectors]]
"""Points, (K, 3), and unit normals, (K, 3), of planes by their numbers, (K,)."""


class Slabs(Record):
    """One level of the tree: K disc-shaped slabs, each around a cluster of vertices."""

    centre: NDArray[np.float64]  # (K, 3)
    axis: NDArray[np.float64]  # (K, 3) unit normal of the slab
    low: NDArray[np.float64]  # (K,) lowest point along the axis, from the centre
    high: NDArray[np.float64]  # (K,) highest point along the axis
    radius: NDArray[np.float64]  # (K,) across the axis


class PlaneGroups(Record):
    """One bound for each group of `GROUP` similar planes.

    For any plane of the group, through o with normal n, and for any x:
    n.(x - o) <= axis.(x - centre) + spread |x - centre| + margin.
    """

    centre: NDArray[np.float64]  # (G, 3)
    axis: NDArray[np.float64]  # (G, 3)
    spread: NDArray[np.float64]  # (G,)
    margin: NDArray[np.float64]  # (G,)


class ClusterTree:
    """Tests whether any vertex of the occluders is above a plane; safe to use from several threads.

    The tree is built with the first plane that the cheap tests cannot decide.
    """

    def __init__(self, vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> None:
        used = np.zeros(len(vertices), bool)
        used[triangles.ravel()] = True
        self._points = np.asarray(vertices[used], np.float64, order="C")
        self._extremes = extremes(self._points)
        self._levels: list[Slabs] | None = None
        self._building = threading.Lock()

    def _tree(self) -> list[Slabs]:
        """Levels of clusters, the finest first; building them puts the points into spatial order."""
        with self._building:
            if self._levels is None:
                self._points = self._points[compact(self._points)]
                levels, size = [], FANOUT
                while len(self._points) > size:
                    levels.append(slabs(self._points, size))
                    size *= FANOUT
                self._levels = levels
        return self._levels

    def is_open(self, count: int, planes: PlanesAt) -> NDArray[np.bool_]:
        """(count,) True where no occluder reaches above a plane.

        False may also mean undecided, if the plane's group would visit more than `MAX_CLUSTERS`.

        Parameters
        ----------
        planes
            Origins of planes, above the surface by more than the rounding of this test [radii], and unit
            normals; asked only for those that are tested. Consecutive planes should be close together.
        """
        if not len(self._points):
            return np.ones(count, bool)

        # Test a sample of the groups first.
        group = np.arange(count) // GROUP
        is_trial = group % TRIAL_STEP == 0
        out = np.zeros(count, bool)
        self._test(out, np.flatnonzero(is_trial), planes)

        # Test the neighbours of groups that have an open plane.
        promising = np.bincount(group // TRIAL_STEP, out) > 0
        self._test(out, np.flatnonzero(~is_trial & promising[group // TRIAL_STEP]), planes)
        return out

    def _test(self, out: NDArray[np.bool_], index: NDArray[np.int64], planes: PlanesAt) -> None:
        """Write the results for these planes into `out`, a batch at a time."""
        for first in range(0, len(index), GROUP * GROUPS_AT_ONCE):
            batch = index[first : first + GROUP * GROUPS_AT_ONCE]
            o, up = (np.asarray(each, np.float64) for each in planes(batch))
            out[batch] = self._tested(o, up)

    def _tested(self, o: NDArray[np.float64], n: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(M,) True where no occluder is above the plane: by the cheap tests, then by the tree if enough
        points are left."""
        out = self._passes_cheap_tests(o, n)
        candidates = np.flatnonzero(out)
        if len(candidates) < MIN_CANDIDATES * len(o):
            return np.zeros(len(o), bool)
        if candidates.size:
            out[candidates] = self._all_below(o[candidates], n[candidates])
        return out

    def open_planes(self, o: NDArray[np.float64], n: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(M,) as `is_open`, but every `GROUP` consecutive planes are decided independently of all others.

        The planes pass through points of occluders, offset as ray origins are. M is a multiple of `GROUP`.
        """
        out = self._candidates(o, n)
        tested = np.repeat(out.reshape(-1, GROUP).any(axis=1), GROUP)
        if tested.any():
            out[tested] &= self._all_below(o[tested], n[tested])
        return out

    def is_promising(self, o: Vectors, n: Vectors) -> bool:
        """True if enough of these planes pass the cheap tests for `open_planes` to be worth its time."""
        return bool(self._candidates(o, n).sum() >= MIN_CANDIDATES * len(o))

    def _candidates(self, o: Vectors, n: Vectors) -> NDArray[np.bool_]:
        """(M,) True for planes that pass the cheap tests, in groups where at least half of the planes do.

        In other groups most planes have geometry above them, and the tree would decide few of the rest.
        """
        out = self._passes_cheap_tests(o, n)
        groups = out.reshape(-1, GROUP)
        groups[groups.sum(axis=1) * 2 < GROUP] = False
        return out

    def _passes_cheap_tests(self, o: Vectors, n: Vectors) -> NDArray[np.bool_]:
        """(M,) False where an extreme vertex, or a point of the same group, is clearly above the plane."""
        height = np.einsum("ij,ij->i", o, n)
        out = (n.astype(F) @ self._extremes.T).max(axis=1) <= height + CLEARANCE
        for first in range(0, len(o), GROUP) if out.any() else ():
            group = slice(first, first + GROUP)
            if out[group].any():
                out[group] &= is_above_group(o[group], n[group])
        return out

    def _all_below(self, o: NDArray[np.float64], n: NDArray[np.float64]) -> NDArray[np.bool_]:
        """(M,) True where all vertices are below the plane; False where one is above, or undecided."""
        planes = plane_groups(o, n)
        group, cluster, resolved = self._clusters_above(planes)
        out = np.zeros(len(o), bool)
        bounds = np.searchsorted(group, np.arange(len(planes.centre) + 1))
        for g in np.flatnonzero(resolved):
            # Compare each plane of the group with every vertex of its clusters.
            members = slice(g * GROUP, (g + 1) * GROUP)
            first = cluster[bounds[g] : bounds[g + 1]] * FANOUT
            vertex = (first[:, None] + np.arange(FANOUT)).ravel()
            near = self._points[vertex[vertex < len(self._points)]]
            height = np.einsum("ij,ij->i", o[members], n[members])
            out[members] = (n[members] @ near.T).max(axis=1, initial=-np.inf) <= height
        return out

    def _clusters_above(
        self, planes: PlaneGroups
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Clusters of `FANOUT` vertices that may reach above a plane of a group.

        Returns
        -------
        group, cluster : (K,) int64
            Pairs, ordered by group.
        resolved : (G,) bool
            True for groups with all their pairs, False for groups with more than `MAX_CLUSTERS`.
        """
        count = len(planes.centre)
        resolved = np.ones(count, bool)
        group, cluster = np.arange(count), np.zeros(count, np.int64)  # the root, which holds all vertices
        for level in reversed(self._tree()):
            # Give up groups with too many clusters; of the others, descend to the children.
            is_small = np.bincount(group, minlength=count) <= MAX_CLUSTERS // FANOUT
            resolved &= is_small
            group, cluster = group[is_small[group]], cluster[is_small[group]]
            group = np.repeat(group, FANOUT)
            cluster = (cluster[:, None] * FANOUT + np.arange(FANOUT)).ravel()
            exists = cluster < len(level.centre)
            group, cluster = group[exists], cluster[exists]

            # Bound the slab's height above the group's axis, and its distance from the group's centre.
            axis = planes.axis[group]
            away = level.centre[cluster] - planes.centre[group]
            cosine = np.einsum("ij,ij->i", axis, level.axis[cluster])
            low, high, radius = level.low[cluster], level.high[cluster], level.radius[cluster]
            height = np.einsum("ij,ij->i", axis, away) + np.maximum(cosine * high, cosine * low)
            height += np.sqrt(np.maximum(1 - cosine * cosine, 0)) * radius
            distance = np.sqrt(np.einsum("ij,ij->i", away, away)) + radius + np.maximum(high, -low)

            # Keep the clusters that may reach above some plane.
            is_above = height + planes.spread[group] * distance + planes.margin[group] > 0
            group, cluster = group[is_above], cluster[is_above]
        return group, cluster, resolved


class OpenTriangles:
    """Triangles with nothing above their plane, for both sides; safe to use from several threads.

    All samples of a triangle share one plane, so each triangle is tested once, together with the 63 others of
    its group. The result depends on the group alone, whichever sample needs it first. If almost no triangle
    of a few trial groups over the scene is open, as on a scanned mesh, no other group is tested.
    """

    def __init__(self, geometry: SceneGeometry) -> None:
        self._geometry = geometry
        self._tree = ClusterTree(geometry.vertices, geometry.triangles)
        self._groups = -(-len(geometry.triangles) // GROUP)  # of each side
        self._tested = np.zeros(2 * self._groups, bool)
        self._open = np.zeros(2 * self._groups * GROUP, bool)
        trial = np.arange(0, 2 * self._groups, max(1, self._groups // TRIAL_GROUPS))
        self._promising = len(trial) > 0 and self._tree.is_promising(*self._planes(trial))

    def is_open(self, triangle: Ids, back_facing: NDArray[np.bool_], min_samples: int) -> NDArray[np.bool_]:
        """(M,) True where nothing is above a sample's triangle, on the eye's side.

        Groups of triangles with fewer than `min_samples` of the samples are not tested.
        """
        if not self._promising:
            return np.zeros(len(triangle), bool)

        # Test the groups that enough samples lie on and that no other call has tested.
        plane = triangle + back_facing * np.int64(self._groups * GROUP)
        group = plane // GROUP
        is_wanted = np.bincount(group, minlength=2 * self._groups) >= min_samples
        new = np.flatnonzero(is_wanted & ~self._tested)
        for first in range(0, len(new), GROUPS_AT_ONCE):
            self._test(new[first : first + GROUPS_AT_ONCE])
        return self._open.take(plane) & is_wanted.take(group)

    def _test(self, groups: NDArray[np.int64]) -> None:
        self._open[_members(groups)] = self._tree.open_planes(*self._planes(groups))
        self._tested[groups] = True

    def _planes(self, groups: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Origins and unit normals of the planes of these groups, (64 K, 3) each."""
        side, triangle = np.divmod(_members(groups), self._groups * GROUP)
        triangle = np.minimum(triangle, len(self._geometry.triangles) - 1).astype(np.int32)
        return triangle_planes(self._geometry, self._geometry.objects.take(triangle), triangle, side > 0)


MAX_TREE_VERTICES = 1 << 17
"""Scenes with more vertices are not searched for open triangles."""
RAYS_PER_TEST = 1 << 11
"""Rays that take about as long as testing a group of triangles."""


def open_triangles(geometry: SceneGeometry) -> OpenTriangles | None:
    """The search for triangles with nothing above them; None if the scene is too large for it to pay off, or
    has instances, whose vertices Embree places less exactly than this test."""
    if geometry.instances is not None or len(geometry.vertices) > MAX_TREE_VERTICES:
        return None
    return OpenTriangles(geometry)


def known_open(
    samples: int, hits: Hits, interaction: SurfaceInteraction, open_triangles: OpenTriangles | None
) -> NDArray[np.bool_] | None:
    """(M,) True for hits that are known to have nothing above them; the others cast `samples` rays each."""
    if open_triangles is None:
        return None
    return open_triangles.is_open(hits.triangle, interaction.back_facing, RAYS_PER_TEST // samples)


def triangle_planes(
    geometry: SceneGeometry, objects: Ids, triangle: Ids, back_facing: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Origins and unit normals of the planes of N triangles, (N, 3) float64 each; `back_facing` is the side.

    A plane's offset from its triangle is at most that of any ray origin on the triangle.
    """
    zero = np.zeros(len(triangle), F)
    interaction = interact(geometry, objects, triangle, zero, zero, np.zeros((len(triangle), 3), F))
    n = facing(interaction.ng, back_facing).astype(np.float64)
    v0 = interaction.position
    others = (geometry.corner_positions(objects, triangle, k) for k in (1, 2))
    lowest = np.minimum.reduce([np.zeros(len(n)), *(dot(n, other - v0) for other in others)])

    # |ng|.|p| of `offset_ray_origins` is at least the distance of the plane from the centre, so no ray starts
    # lower than this.
    step = lowest + ORIGIN_OFFSET * (np.abs(dot(n, v0)) + interaction.edge)
    o = v0 + step[:, None] * n
    return np.ascontiguousarray(o), np.ascontiguousarray(n)


def trial_planes(planes: NDArray[np.int64]) -> NDArray[np.int64]:
    """`TRIAL_GROUPS` runs of `GROUP` of these numbers, spread evenly; all of them where they are fewer, the
    last one repeated to fill its run."""
    groups = -(-len(planes) // GROUP)
    chosen = np.arange(0, groups, max(1, groups // TRIAL_GROUPS))
    return planes[np.minimum(_members(chosen), len(planes) - 1)]


def _members(groups: NDArray[np.int64]) -> NDArray[np.int64]:
    """(64 K,) numbers of the planes in K groups."""
    return (groups[:, None] * GROUP + np.arange(GROUP)).ravel()


def is_above_group(o: Vectors, n: Vectors) -> NDArray[np.bool_]:
    """(M,) False where one of the points is clearly above the plane of another.

    The points lie on occluders, offset by a hundredth of `CLEARANCE`, so this decides most concave regions.
    """
    near, up = (o - o[0]).astype(F), n.astype(F)
    return (up @ near.T).max(axis=1) <= np.einsum("ij,ij->i", up, near) + CLEARANCE


def plane_groups(o: NDArray[np.float64], n: NDArray[np.float64]) -> PlaneGroups:
    """The bounds of every `GROUP` consecutive planes, through `o` with unit normals `n`, (M, 3) each."""
    # Pad the last group with copies of the last plane.
    count = -(-len(o) // GROUP)
    missing = count * GROUP - len(o)
    o = np.concatenate([o, np.repeat(o[-1:], missing, axis=0)]).reshape(count, GROUP, 3)
    n = np.concatenate([n, np.repeat(n[-1:], missing, axis=0)]).reshape(count, GROUP, 3)

    # The axis is the mean normal; where normals cancel, the first one.
    centre, axis = o.mean(axis=1), n.mean(axis=1)
    size = np.linalg.norm(axis, axis=1, keepdims=True)
    axis = np.where(size > 0.1, axis / np.maximum(size, 0.1), n[:, 0])
    spread = np.linalg.norm(n - axis[:, None], axis=2).max(axis=1)
    margin = -np.einsum("gpi,gpi->gp", n, o - centre[:, None]).min(axis=1)
    return PlaneGroups(centre, axis / np.linalg.norm(axis, axis=1, keepdims=True), spread, margin)


def slabs(points: NDArray[np.float64], size: int) -> Slabs:
    """A slab around every `size` consecutive points, along the plane that fits them best."""
    count = -(-len(points) // size)
    padded = np.concatenate([points, np.repeat(points[-1:], count * size - len(points), axis=0)])
    group = padded.reshape(count, size, 3)

    # The axis is the direction of least variance.
    centre = group.mean(axis=1)
    centred = group - centre[:, None]
    _, vectors = np.linalg.eigh(np.matmul(centred.transpose(0, 2, 1), centred))
    axis = np.ascontiguousarray(vectors[:, :, 0])

    # Extents along the axis, and across it by Pythagoras.
    along = np.matmul(centred, axis[:, :, None])[:, :, 0]
    across2 = np.matmul(np.square(centred), np.ones(3)) - np.square(along)
    radius = np.sqrt(across2.max(axis=1).clip(0))
    rounding = BOUND_ROUNDING
    return Slabs(centre, axis, along.min(axis=1) - rounding, along.max(axis=1) + rounding, radius + rounding)


def extremes(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """(K, 3) the extreme points in `DIRECTIONS` directions, which are spread evenly over the sphere."""
    k = np.arange(DIRECTIONS)
    z = 1 - (2 * k + 1) / DIRECTIONS
    angle = np.pi * (3 - 5**0.5) * k
    r = np.sqrt(1 - z * z)
    directions = np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)
    if not len(points):
        return points
    single, directions = column_major(points, F), directions.astype(F)
    return points[sorted({int(np.argmax(single @ d)) for d in directions})].astype(F)
