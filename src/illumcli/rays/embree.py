"""Embree queries: closest hit and occlusion. No other folder imports embreex.

embreex checks only the dtype of its arrays. It reads past the end of short ones, overwrites the caller's
distances, takes as long for one NaN ray as for 1500 valid ones, and only logs Embree's errors. So all arrays
are checked or copied here first.
"""

from __future__ import annotations

import logging
import threading
from copy import copy

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, repeat_rows
from illumcli.errors import IllumError
from illumcli.geometry.scene_geometry import SceneGeometry
from illumcli.rays.embree_upload import upload
from illumcli.records import Record

RAYS_PER_CALL = 1 << 18
"""An interrupt waits for one call at most."""
NO_LIMIT = F(1e37)
"""Ray length that is passed to Embree for an unlimited ray."""
RETRY_TURN = F(2.0**-19)
"""Angle [rad] by which a ray that missed is turned for its retry. Embree's robust mode can miss at an exact
vertex (0.2 to 1 % of rays aimed at one). Of the retries none in 3.2 million rays missed; with 2^-20, two."""


class Closest(Record):
    """Closest hits of N rays; a miss has triangle -1 and distance inf."""

    triangle: Ids  # (N,)
    u: Floats  # (N,) weight of corner 1
    v: Floats  # (N,) weight of corner 2
    distance: Floats  # (N,) in lengths of the direction


class Interrupted(Exception):
    """The run was stopped; the results are no longer needed."""


class Tracer:
    """Closest-hit and occlusion queries for arrays of rays on a set of triangles; safe to use from many
    threads.

    There may be fewer origins than directions: each origin is then shared by equally many consecutive rays.
    """

    def __init__(self, vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> None:
        from embreex.rtcore_scene import EmbreeScene

        errors = _Errors()
        log = logging.getLogger("embreex")
        log.addHandler(errors)
        try:
            self._scene = EmbreeScene(robust=True)
            self.triangle_count = len(triangles)
            self.rays = 0
            self._stop: threading.Event | None = None
            if len(triangles):
                upload(self._scene, vertices, triangles)
            # the first query builds the tree if `upload` did not, which must happen before threads start
            probe = np.zeros((1, 3), F)
            self._scene.run(probe, probe + F(1), query="OCCLUDED")
        finally:
            log.removeHandler(errors)
        if errors.texts:
            raise IllumError(f"Embree could not build its tree: {'; '.join(errors.texts)}")

    def counting(self, stop: threading.Event | None = None) -> Tracer:
        """A tracer on the same tree with its own count of `rays`, for one thread.

        Once `stop` is set, every query raises `Interrupted`.
        """
        tracer = copy(self)
        tracer.rays, tracer._stop = 0, stop
        return tracer

    def closest(self, origins: Vectors, directions: Vectors) -> Closest:
        """The closest hit of each ray; a ray that misses is traced again, turned by `RETRY_TURN`."""
        origins = self._per_ray(origins, directions)
        hits = self._closest(origins, directions)
        missed = np.flatnonzero(hits.triangle < 0)
        if missed.size and self.triangle_count:
            d = directions[missed]
            self.rays += len(missed)
            retried = self._closest(origins[missed], d + RETRY_TURN * np.abs(d[:, [1, 2, 0]]))
            for values, others in zip(vars(hits).values(), vars(retried).values(), strict=True):
                values[missed] = others
        return hits

    def _closest(self, origins: Vectors, directions: Vectors) -> Closest:
        count = len(directions)
        hits = Closest(np.empty(count, np.int32), np.empty(count, F), np.empty(count, F), np.empty(count, F))
        for part in _batches(count):
            result = self._scene.run(origins[part], directions[part], query="INTERSECT", output=1)
            hits.triangle[part] = result["primID"]
            hits.u[part] = result["u"]
            hits.v[part] = result["v"]
            hits.distance[part] = result["tfar"]
        hits.distance[hits.triangle < 0] = np.inf
        return hits

    def distance(self, origins: Vectors, directions: Vectors) -> Floats:
        """(N,) distance of each ray's closest hit, inf if it misses; no ray is traced again."""
        origins, count = self._per_ray(origins, directions), len(directions)
        far = np.empty(count, F)
        for part in _batches(count):
            far[part] = self._scene.run(origins[part], directions[part], query="DISTANCE")
        far[far > 1e30] = np.inf
        return far

    def occluded(
        self, origins: Vectors, directions: Vectors, limits: Floats | float = np.inf
    ) -> NDArray[np.bool_]:
        """(N,) True where a triangle lies between a ray's origin and `limits` along its direction.

        The result is False for a limit of 0 or less, where Embree would say True.
        """
        origins, count = self._per_ray(origins, directions), len(directions)
        reach = np.asarray(limits, F)
        if reach.ndim and len(reach) != count:
            raise ValueError(f"{len(reach)} limits for {count} rays")
        lowest = reach.min(initial=np.inf)
        if np.isnan(lowest):
            raise IllumError("a ray's limit is not a number")
        far = np.minimum(reach, NO_LIMIT)
        out = np.empty(count, np.bool_)
        for part in _batches(count):
            # embreex writes to the array of lengths that it is given, so it never gets the caller's
            lengths = far[part] if far.ndim else np.full(part.stop - part.start, far)
            hit = self._scene.run(origins[part], directions[part], lengths, query="OCCLUDED")
            np.greater_equal(hit, 0, out=out[part])
        return out if lowest > 0 else out & (reach > 0)

    def _per_ray(self, origins: Vectors, directions: Vectors) -> Vectors:
        """(N, 3) an origin for each direction, after the checks that embreex leaves out; counts the rays."""
        if self._stop is not None and self._stop.is_set():
            raise Interrupted
        each = _checked(origins, directions)
        self.rays += len(directions)
        return origins if each == 1 else repeat_rows(origins, each)


class _Errors(logging.Handler):
    """Collects what embreex logs instead of raising."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.texts.append(record.getMessage())


def _batches(count: int) -> list[slice]:
    return [slice(first, min(first + RAYS_PER_CALL, count)) for first in range(0, count, RAYS_PER_CALL)]


def _checked(origins: Vectors, directions: Vectors) -> int:
    """Number of directions per origin; raises where an array has another shape or is not finite."""
    for name, array in (("origins", origins), ("directions", directions)):
        if array.ndim != 2 or array.shape[1] != 3 or array.dtype != F:
            raise ValueError(f"{name} must be (N, 3) float32, are {array.shape} {array.dtype}")
        # a sum of squares is three times faster than testing each value, and finite only if all of them are
        flat = array.ravel(order="K")
        with np.errstate(invalid="ignore", over="ignore"):
            total = flat @ flat
        if not np.isfinite(total) and not np.isfinite(array).all():
            bad = int(np.count_nonzero(~np.isfinite(array).all(axis=1)))
            raise IllumError(f"{bad} of {len(array)} rays have {name} that are not finite")
    starts, count = len(origins), len(directions)
    if starts != count and not (0 < starts < count and count % starts == 0):
        raise ValueError(f"{starts} origins for {count} directions")
    return count // starts if starts else 1


def tracer(geometry: SceneGeometry) -> Tracer:
    """Embree's tree over the triangles of a scene, ready for queries."""
    return Tracer(geometry.vertices, geometry.triangles)
