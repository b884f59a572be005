"""Ray queries in packets by a loop in Python, for trees with instances where no compiled loop is available.

embreex does not tell which instance a ray hit. Packets are filled by numpy; each is a call of Embree through
ctypes, which takes about 50 ns a ray. The results have the same bits as those of the compiled loop.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors
from illumcli.rays.embree_library import loaded_library
from illumcli.rays.embree_tree import EmbreeTree, native_widths
from illumcli.rays.pattern_rays import PatternRays, PatternResults
from illumcli.rays.ray_loop import NO_LIMIT, Closest, InstancedMeshes, per_ray, trace_as_arrays

RAYS_PER_CALL = 1 << 14
"""Rays whose packets are filled at once."""
ROWS = 32
ORIGIN, DIRECTION, LIMIT, MASK, ID = 0, 4, 8, 9, 10
U, V, TRIANGLE, INSTANCE, GEOMETRY = 15, 16, 17, 19, 18
"""Rows of a packet, RTCRayHit16 of rtcore_ray.h; more than Embree uses."""
ALIGNMENT = 64
ALL_BITS = -1


class PythonPacketLoop:
    """Packets of the widest native width, or of 4 rays."""

    def __init__(
        self, vertices: NDArray[np.float32], triangles: NDArray[np.int32], instanced: InstancedMeshes
    ) -> None:
        self._tree = EmbreeTree(vertices, triangles, instanced)
        self.width = (*native_widths(), 4)[0]

    def occluded(
        self, origins: Vectors, directions: Vectors, limits: Floats, coherent: bool = False
    ) -> NDArray[np.bool_]:
        origins, out = per_ray(origins, directions), np.empty(len(directions), np.bool_)
        for part in _batches(len(directions)):
            far = limits[part] if limits.ndim else limits
            packets = self._traced("rtcOccluded", origins[part], directions[part], far)
            out[part] = _row(packets, LIMIT, part) < 0  # Embree sets it to -inf
        return out

    def closest(self, origins: Vectors, directions: Vectors, coherent: bool = False) -> Closest:
        origins, hits = per_ray(origins, directions), Closest.empty(len(directions))
        for part in _batches(len(directions)):
            packets = self._traced("rtcIntersect", origins[part], directions[part], NO_LIMIT)
            numbers = packets.view(np.int32)
            hits.triangle[part] = _row(numbers, TRIANGLE, part)
            geometry = _row(numbers, INSTANCE, part)
            hits.instance[part] = np.where(geometry < 0, geometry, geometry - self._tree.first_instance)
            hits.u[part], hits.v[part] = _row(packets, U, part), _row(packets, V, part)
            hits.distance[part] = _row(packets, LIMIT, part)
        return hits

    def distance(self, origins: Vectors, directions: Vectors) -> Floats:
        return self.closest(origins, directions).distance

    def trace_patterns(self, rays: PatternRays, limit: float, out: PatternResults) -> None:
        trace_as_arrays(self, rays, limit, out)

    def _traced(
        self, query: str, origins: Vectors, directions: Vectors, limits: Floats | np.float32
    ) -> NDArray[np.float32]:
        """(P, ROWS, width) the packets of some rays, after the query."""
        # Places beyond the last ray are not valid.
        count, width = len(directions), self.width
        packets = _aligned((-(-count // width), ROWS, width))
        by_ray = packets.transpose(1, 0, 2).reshape(ROWS, -1)
        for k in range(3):
            by_ray[ORIGIN + k, :count], by_ray[DIRECTION + k, :count] = origins[:, k], directions[:, k]
        by_ray[LIMIT, :count] = limits
        packets[:] = by_ray.reshape(ROWS, -1, width).transpose(1, 0, 2)
        numbers = packets.view(np.int32)
        numbers[:, MASK] = ALL_BITS
        numbers[:, ID] = np.arange(width)
        for row in (TRIANGLE, GEOMETRY, INSTANCE):
            numbers[:, row] = -1
        valid = _aligned((len(packets), width)).view(np.int32)
        valid[:] = -(np.arange(len(packets) * width) < count).reshape(valid.shape).astype(np.int32)

        # One call per packet.
        trace, scene = getattr(loaded_library(), f"{query}{width}"), self._tree.scene
        step, first, first_valid = packets[:1].nbytes, packets.ctypes.data, valid.ctypes.data
        for number in range(len(packets)):
            trace(first_valid + number * 4 * width, scene, first + number * step, None)
        return packets


def _batches(count: int) -> list[slice]:
    return [slice(first, min(first + RAYS_PER_CALL, count)) for first in range(0, count, RAYS_PER_CALL)]


def _row(packets: NDArray[Any], row: int, part: slice) -> NDArray[Any]:
    """A row of all packets, one value per ray of `part`."""
    return packets[:, row].ravel()[: part.stop - part.start]


def _aligned(shape: tuple[int, ...]) -> NDArray[np.float32]:
    """Zeros whose first address Embree can load whole packets from."""
    size = int(np.prod(shape))
    room = np.zeros(size + ALIGNMENT // 4, F)
    skip = -room.ctypes.data % ALIGNMENT // 4
    return room[skip : skip + size].reshape(shape)
