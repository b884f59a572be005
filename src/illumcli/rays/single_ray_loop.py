"""Ray queries by embreex's own loop over single rays, used where packets are not available.

embreex checks only the dtype of its arrays. It reads past the end of short ones, overwrites the caller's
distances, and only logs Embree's errors.
"""

from __future__ import annotations

import logging
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors
from illumcli.errors import IllumError
from illumcli.rays.embree_upload import upload
from illumcli.rays.pattern_rays import PatternRays, PatternResults
from illumcli.rays.ray_loop import Closest, batches, per_ray, trace_as_arrays


class SingleRayLoop:
    """An EmbreeScene over triangles."""

    def __init__(self, vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> None:
        errors = _Errors()
        log = logging.getLogger("embreex")
        log.addHandler(errors)
        try:
            self._scene = _new_scene()
            if len(triangles):
                upload(self._scene, vertices, triangles)
            # the first query builds the tree if `upload` did not, which must happen before threads start
            probe = np.zeros((1, 3), F)
            self._scene.run(probe, probe + F(1), query="OCCLUDED")
        except MemoryError:
            _device.cache_clear()  # embreex keeps a device that Embree could not allocate
            raise
        finally:
            log.removeHandler(errors)
        if errors.texts:
            raise IllumError(f"Embree could not build its tree: {'; '.join(errors.texts)}")

    def occluded(
        self, origins: Vectors, directions: Vectors, limits: Floats, coherent: bool = False
    ) -> NDArray[np.bool_]:
        origins = per_ray(origins, directions)
        out = np.empty(len(directions), np.bool_)
        for part in batches(len(directions)):
            # embreex writes to the array of lengths that it is given, so it never gets the caller's
            lengths = limits[part].copy() if limits.ndim else np.full(part.stop - part.start, limits)
            hit = self._scene.run(origins[part], directions[part], lengths, query="OCCLUDED")
            np.greater_equal(hit, 0, out=out[part])
        return out

    def closest(self, origins: Vectors, directions: Vectors, coherent: bool = False) -> Closest:
        origins = per_ray(origins, directions)
        hits = Closest.empty(len(directions))
        hits.instance.fill(-1)
        for part in batches(len(directions)):
            result = self._scene.run(origins[part], directions[part], query="INTERSECT", output=1)
            hits.triangle[part] = result["primID"]
            hits.u[part] = result["u"]
            hits.v[part] = result["v"]
            hits.distance[part] = result["tfar"]
        return hits

    def distance(self, origins: Vectors, directions: Vectors) -> Floats:
        origins = per_ray(origins, directions)
        out = np.empty(len(directions), F)
        for part in batches(len(directions)):
            out[part] = self._scene.run(origins[part], directions[part], query="DISTANCE")
        return out

    def trace_patterns(self, rays: PatternRays, limit: float, out: PatternResults) -> None:
        trace_as_arrays(self, rays, limit, out)


def _new_scene() -> Any:
    """An EmbreeScene of the one device of this process, which can make about a thousand."""
    from embreex.rtcore_scene import EmbreeScene

    return EmbreeScene(_device(), robust=True)


@cache
def _device() -> Any:
    from embreex.rtcore import EmbreeDevice

    return EmbreeDevice()


class _Errors(logging.Handler):
    """Collects what embreex logs instead of raising."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.texts.append(record.getMessage())
