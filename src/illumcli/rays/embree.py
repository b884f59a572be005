"""Embree queries: closest hit and occlusion. No other folder imports embreex.

embreex checks only the type of its arrays. It reads past the end of short ones, overwrites the caller's
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

AT_ONCE = 1 << 18
"""Rays per call: an interrupt waits for one call at most."""
FARTHEST = F(1e37)
"""A limit that stands for none."""
TURN = F(2.0**-19)
"""By how much [rad] a ray that missed is turned for its second shot: Embree's robust mode can miss at an
exact vertex (0.2 to 1 % of rays aimed at one); of the second shots 0 in 3.2 million rays, 2 at 2^-20."""


class Closest(Record):
    """First hits of N rays; a miss has triangle -1 and distance inf."""

    triangle: Ids  # (N,)
    u: Floats  # (N,) weight of corner 1
    v: Floats  # (N,) weight of corner 2
    distance: Floats  # (N,) in lengths of the direction


class Interrupted(Exception):
    """The run was stopped; nobody waits for the answer."""


class Tracer:
    """Two questions about a set of triangles, asked with arrays; safe to ask from many threads.

    There may be fewer origins than directions: each then stands for as many rays in a row.
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
            # the first ray builds the tree where it is not built yet, which must happen before threads ask
            probe = np.zeros((1, 3), F)
            self._scene.run(probe, probe + F(1), query="OCCLUDED")
        finally:
            log.removeHandler(errors)
        if errors.texts:
            raise IllumError(f"the ray core failed to build: {'; '.join(errors.texts)}")

    def counting(self, stop: threading.Event | None = None) -> Tracer:
        """The same ray core with a count of `rays` of its own, for one thread.

        Once `stop` is set every question raises `Interrupted`.
        """
        own = copy(self)
        own.rays, own._stop = 0, stop
        return own

    def closest(self, origins: Vectors, directions: Vectors) -> Closest:
        """What each ray hits first; a ray that misses is shot a second time, turned by 2^-19 rad."""
        origins = self._asked(origins, directions)
        hits = self._closest(origins, directions)
        again = np.flatnonzero(hits.triangle < 0)
        if again.size and self.triangle_count:
            d = directions[again]
            self.rays += len(again)
            second = self._closest(origins[again], d + TURN * np.abs(d[:, [1, 2, 0]]))
            for values, others in zip(vars(hits).values(), vars(second).values(), strict=True):
                values[again] = others
        return hits

    def _closest(self, origins: Vectors, directions: Vectors) -> Closest:
        count = len(directions)
        hits = Closest(np.empty(count, np.int32), np.empty(count, F), np.empty(count, F), np.empty(count, F))
        for part in _parts(count):
            answer = self._scene.run(origins[part], directions[part], query="INTERSECT", output=1)
            hits.triangle[part] = answer["primID"]
            hits.u[part] = answer["u"]
            hits.v[part] = answer["v"]
            hits.distance[part] = answer["tfar"]
        hits.distance[hits.triangle < 0] = np.inf
        return hits

    def distance(self, origins: Vectors, directions: Vectors) -> Floats:
        """(N,) distance to what each ray hits first, inf where it hits nothing."""
        origins, count = self._asked(origins, directions), len(directions)
        far = np.empty(count, F)
        for part in _parts(count):
            far[part] = self._scene.run(origins[part], directions[part], query="DISTANCE")
        far[far > 1e30] = np.inf
        return far

    def occluded(
        self, origins: Vectors, directions: Vectors, limits: Floats | float = np.inf
    ) -> NDArray[np.bool_]:
        """(N,) True where anything stands between an origin and `limits` along its direction.

        A limit of 0 or less asks nothing and answers False, where Embree would answer True.
        """
        origins, count = self._asked(origins, directions), len(directions)
        reach = np.asarray(limits, F)
        if reach.ndim and len(reach) != count:
            raise ValueError(f"{len(reach)} limits for {count} rays")
        lowest = reach.min(initial=np.inf)
        if np.isnan(lowest):
            raise IllumError("a ray's limit is not a number")
        far = np.minimum(reach, FARTHEST)
        out = np.empty(count, np.bool_)
        for part in _parts(count):
            # embreex gets an array of its own: it may write to it
            own = far[part] if far.ndim else np.full(part.stop - part.start, far)
            hit = self._scene.run(origins[part], directions[part], own, query="OCCLUDED")
            np.greater_equal(hit, 0, out=out[part])
        return out if lowest > 0 else out & (reach > 0)

    def _asked(self, origins: Vectors, directions: Vectors) -> Vectors:
        """An origin for each direction, after a look at everything that Embree does not look at."""
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


def _parts(count: int) -> list[slice]:
    return [slice(a, min(a + AT_ONCE, count)) for a in range(0, count, AT_ONCE)]


def _checked(origins: Vectors, directions: Vectors) -> int:
    """How many directions there are to an origin; everything is finite and has its shape."""
    for name, array in (("origins", origins), ("directions", directions)):
        if array.ndim != 2 or array.shape[1] != 3 or array.dtype != F:
            raise ValueError(f"{name} must be (N, 3) float32, are {array.shape} {array.dtype}")
        # a sum of squares is three times faster than a look at each, and finite only where all of them are
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
    """The ray core over the triangles of a scene."""
    return Tracer(geometry.vertices, geometry.triangles)
