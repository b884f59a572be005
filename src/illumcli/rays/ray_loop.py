"""Loops over rays that query Embree: their interface, and which of them is used."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, repeat_rows
from illumcli.compiled import SWITCH, are_switched_off
from illumcli.rays.pattern_rays import PatternRays, PatternResults
from illumcli.records import Record

RAYS_PER_CALL = 1 << 18
"""An interrupt waits for one call at most."""
PATTERN_RAYS_PER_CALL = 1 << 17
"""Rays whose directions are formed at once: a tenth faster than 2^14, with two threads a fifth, although the
arrays of 2^14 rays would fit into the processor's cache. In long batches Embree's own data stay there."""
NO_LIMIT = F(1e37)
"""Ray length that is passed to Embree for an unlimited ray."""


class Closest(Record):
    """Closest hits of N rays; a miss has triangle -1 and distance inf."""

    triangle: Ids  # (N,)
    instance: Ids  # (N,) number of the instance, -1 where that is none
    u: Floats  # (N,) weight of corner 1
    v: Floats  # (N,) weight of corner 2
    distance: Floats  # (N,) in lengths of the direction

    @classmethod
    def empty(cls, count: int) -> Closest:
        """Uninitialized hits of `count` rays."""
        triangle, instance = np.empty(count, np.int32), np.empty(count, np.int32)
        return cls(triangle, instance, np.empty(count, F), np.empty(count, F), np.empty(count, F))

    def replace(self, index: NDArray[np.intp], others: Closest) -> None:
        """Replace the hits of some rays."""
        for values, new in zip(vars(self).values(), vars(others).values(), strict=True):
            values[index] = new


class InstancedMeshes(Record):
    """Meshes that each have a tree of their own, and I instances of them."""

    vertices: tuple[NDArray[np.float32], ...]  # (V, 3) of each mesh, in a space of its own
    triangles: tuple[NDArray[np.int32], ...]  # (T, 3) of each mesh
    mesh: NDArray[np.int32]  # (I,) of each instance
    matrix: NDArray[np.float32]  # (I, 3, 4) from the mesh's space to that of the rays
    first_triangle: NDArray[np.int32]  # (I,) number of the mesh's first triangle among those of all


class RayLoop(Protocol):
    """Embree's tree over triangles and instances, and a loop that queries it for arrays of finite rays.

    Triangles of an instance are numbered within its mesh.

    There may be fewer origins than directions: each origin is then shared by equally many consecutive rays.
    All loops give the same bits. The distance of a miss is `NO_LIMIT`.
    """

    def occluded(
        self, origins: Vectors, directions: Vectors, limits: Floats, coherent: bool = False
    ) -> NDArray[np.bool_]:
        """(N,) True where a triangle lies between a ray's origin and its limit, or the limit is below 0.

        Parameters
        ----------
        limits : (N,) or () float32
            Along the directions, at most `NO_LIMIT`.
        coherent : bool
            True if consecutive rays have like origins and directions; changes the time only.
        """
        ...

    def closest(self, origins: Vectors, directions: Vectors, coherent: bool = False) -> Closest:
        """The closest hit of each ray; `coherent` as above."""
        ...

    def distance(self, origins: Vectors, directions: Vectors) -> Floats:
        """(N,) distance of each ray's closest hit."""
        ...

    def trace_patterns(self, rays: PatternRays, limit: float, out: PatternResults) -> None:
        """Fill `out`, whose `open` is 0, with the results of rays that are `limit` long."""
        ...


def ray_loop(
    vertices: NDArray[np.float32], triangles: NDArray[np.int32], instanced: InstancedMeshes | None = None
) -> RayLoop:
    """The fastest loop that is available, over these triangles and instances."""
    if why_no_packets() is None:
        from illumcli.rays.packet_loop import PacketLoop

        return PacketLoop(vertices, triangles, instanced=instanced)
    if instanced is not None:
        from illumcli.rays.python_packet_loop import PythonPacketLoop

        return PythonPacketLoop(vertices, triangles, instanced)
    from illumcli.rays.single_ray_loop import SingleRayLoop

    return SingleRayLoop(vertices, triangles)


def why_no_packets() -> str | None:
    """Why rays are not traced in packets; None if they are."""
    if are_switched_off():
        return f"{SWITCH}=0"
    from illumcli.rays.packet_loop import missing

    return missing()


def ray_loop_name() -> str:
    """Which loop is used, and why if it is the slower one."""
    why = why_no_packets()
    if why is not None:
        return f"single rays by embreex ({why})"
    from illumcli.rays.packet_loop import native_widths

    return f"packets of {native_widths()[0]} rays"


def trace_as_arrays(loop: RayLoop, rays: PatternRays, limit: float, out: PatternResults) -> None:
    """`RayLoop.trace_patterns` by the loop's other queries, with the rays formed as arrays."""
    points, samples = rays.shape
    per_call = max(1, PATTERN_RAYS_PER_CALL // max(samples, 1))
    for first in range(0, points, per_call):
        part = slice(first, min(first + per_call, points))
        batch = rays.between(part.start, part.stop)
        starts, d = batch.starts(), batch.directions()
        if out.directions is not None:
            out.directions[:, part] = d.T.reshape(3, -1, samples)
        if out.distance is not None:
            out.distance[part] = loop.distance(starts, d).reshape(-1, samples)
            continue
        is_open = ~loop.occluded(starts, d, np.asarray(limit, F)).reshape(-1, samples)
        out.open[part] = is_open.astype(F) @ np.ones(samples, F)  # exact below 2^24
        if out.is_open is not None:
            out.is_open[part] = is_open


def per_ray(origins: Vectors, directions: Vectors) -> Vectors:
    """An origin for each direction."""
    each = len(directions) // max(len(origins), 1)
    return origins if each <= 1 else repeat_rows(origins, each)


def batches(count: int) -> list[slice]:
    """The rays of each call."""
    return [slice(first, min(first + RAYS_PER_CALL, count)) for first in range(0, count, RAYS_PER_CALL)]
