"""Embree queries: closest hit and occlusion. Only this folder uses Embree.

Embree takes as long for one NaN ray as for 1500 valid ones, and the loops over rays check nothing. So all
arrays are checked here first.
"""

from __future__ import annotations

import threading
from copy import copy

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors, take_rows
from illumcli.errors import IllumError
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.rays.pattern_rays import PatternRays, PatternResults
from illumcli.rays.ray_loop import NO_LIMIT, Closest, InstancedMeshes, ray_loop

RETRY_TURN = F(2.0**-19)
"""Angle [rad] by which a ray that missed is turned for its retry. Embree's robust mode can miss at an exact
vertex (0.2 to 1 % of rays aimed at one). Of the retries none in 3.2 million rays missed; with 2^-20, two."""


class Interrupted(Exception):
    """The run was stopped; the results are no longer needed."""


class Tracer:
    """Closest-hit and occlusion queries for arrays of rays on triangles and instances; safe in many threads.

    There may be fewer origins than directions: each origin is then shared by equally many consecutive rays.
    """

    def __init__(
        self,
        vertices: NDArray[np.float32],
        triangles: NDArray[np.int32],
        instanced: InstancedMeshes | None = None,
    ) -> None:
        self._loop = ray_loop(vertices, triangles, instanced)
        self._instanced = instanced
        self.is_empty = not len(triangles) and instanced is None
        self.rays = 0
        self._stop: threading.Event | None = None

    def counting(self, stop: threading.Event | None = None) -> Tracer:
        """A tracer on the same tree with its own count of `rays`, for one thread.

        Once `stop` is set, every query raises `Interrupted`.
        """
        tracer = copy(self)
        tracer.rays, tracer._stop = 0, stop
        return tracer

    def closest(
        self, origins: Vectors, directions: Vectors, retry: bool = True, coherent: bool = False
    ) -> Closest:
        """The closest hit of each ray; to `retry`, a ray that misses is traced again, turned by `RETRY_TURN`.

        Rays that are `coherent` have origins and directions like those before and after them; this changes
        the time only.
        """
        self._admit(origins, directions)
        hits = self._closest(origins, directions, coherent)
        missed = np.flatnonzero(hits.triangle < 0)
        if retry and missed.size and not self.is_empty:
            # Most of them miss again, which an occlusion query tells in less time.
            self.rays += len(missed)
            d = take_rows(directions, missed)
            o = take_rows(origins, missed // (len(directions) // len(origins)))
            turned = d + RETRY_TURN * np.abs(d[:, [1, 2, 0]])
            again = np.flatnonzero(self._loop.occluded(o, turned, np.asarray(NO_LIMIT), coherent))
            if again.size:
                closest = self._closest(take_rows(o, again), take_rows(turned, again), coherent)
                hits.replace(missed[again], closest)
        return hits

    def _closest(self, origins: Vectors, directions: Vectors, coherent: bool) -> Closest:
        hits = self._loop.closest(origins, directions, coherent)
        hits.distance[hits.triangle < 0] = np.inf
        if self._instanced is not None:
            within = np.flatnonzero(hits.instance >= 0)
            hits.triangle[within] += self._instanced.first_triangle.take(hits.instance[within])
        return hits

    def distance(self, origins: Vectors, directions: Vectors) -> Floats:
        """(N,) distance of each ray's closest hit, inf if it misses; no ray is traced again."""
        self._admit(origins, directions)
        far = self._loop.distance(origins, directions)
        far[far > 1e30] = np.inf
        return far

    def occluded(
        self, origins: Vectors, directions: Vectors, limits: Floats | float = np.inf, coherent: bool = False
    ) -> NDArray[np.bool_]:
        """(N,) True where a triangle lies between a ray's origin and `limits` along its direction.

        The result is False for a limit of 0 or less, where Embree would say True; `coherent` as for
        `closest`.
        """
        self._admit(origins, directions)
        reach = np.asarray(limits, F)
        if reach.ndim and len(reach) != len(directions):
            raise ValueError(f"{len(reach)} limits for {len(directions)} rays")
        lowest = reach.min(initial=np.inf)
        if np.isnan(lowest):
            raise IllumError("a ray's limit is not a number")
        far = np.asarray(np.minimum(reach, NO_LIMIT))
        out = self._loop.occluded(origins, directions, far, coherent)
        return out if lowest > 0 else out & (reach > 0)

    def trace_patterns(self, rays: PatternRays, limit: float, out: PatternResults) -> None:
        """Fill `out`, whose `open` is 0, with the results of rays that are `limit` long.

        A miss is at `limit` or beyond, at inf if there is none.
        """
        if self._stop is not None and self._stop.is_set():
            raise Interrupted
        for name, array in (("origins", rays.origins), ("directions", rays.frames.reshape(-1, 3))):
            _check_finite(name, array)
        if not limit > 0:
            raise ValueError(f"the limit of rays must be above 0, is {limit}")
        points, samples = rays.shape
        self.rays += points * samples
        self._loop.trace_patterns(rays, min(limit, float(NO_LIMIT)), out)
        if out.distance is not None:
            out.distance[out.distance > 1e30] = np.inf

    def _admit(self, origins: Vectors, directions: Vectors) -> None:
        """Check the rays as the loops do not, and count them."""
        if self._stop is not None and self._stop.is_set():
            raise Interrupted
        _check(origins, directions)
        self.rays += len(directions)


def _check(origins: Vectors, directions: Vectors) -> None:
    """Raise where an array has another shape or is not finite."""
    for name, array in (("origins", origins), ("directions", directions)):
        if array.ndim != 2 or array.shape[1] != 3 or array.dtype != F:
            raise ValueError(f"{name} must be (N, 3) float32, are {array.shape} {array.dtype}")
        _check_finite(name, array)
    starts, count = len(origins), len(directions)
    if starts != count and not (0 < starts < count and count % starts == 0):
        raise ValueError(f"{starts} origins for {count} directions")


def _check_finite(name: str, array: Vectors) -> None:
    # a sum of squares is three times faster than testing each value, and finite only if all of them are
    flat = array.ravel(order="K")
    with np.errstate(invalid="ignore", over="ignore"):
        total = flat @ flat
    if not np.isfinite(total) and not np.isfinite(array).all():
        bad = int(np.count_nonzero(~np.isfinite(array).all(axis=1)))
        raise IllumError(f"{bad} of {len(array)} rays have {name} that are not finite")


def tracer(geometry: SceneGeometry) -> Tracer:
    """Embree's tree over the triangles and instances of a scene, ready for queries."""
    shared = geometry.instances
    if shared is None:
        return Tracer(geometry.vertices, geometry.triangles)

    # The shared meshes come last.
    first = int(shared.placed.min())
    meshes = geometry.placed[first:]
    ends = [*meshes[1:], None]
    parts = [
        (
            slice(each.first_vertex, None if end is None else end.first_vertex),
            slice(each.first_triangle, None if end is None else end.first_triangle),
        )
        for each, end in zip(meshes, ends, strict=True)
    ]
    instanced = InstancedMeshes(
        tuple(geometry.vertices[vertices] for vertices, _ in parts),
        tuple(geometry.triangles[triangles] - np.int32(vertices.start) for vertices, triangles in parts),
        shared.placed - np.int32(first),
        shared.matrix,
        np.array([placed.first_triangle for placed in meshes], np.int32).take(shared.placed - first),
    )
    own = geometry.vertices[: meshes[0].first_vertex], geometry.triangles[: meshes[0].first_triangle]
    return Tracer(*own, instanced)
