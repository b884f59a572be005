"""Loops over rays that query Embree: their interface, and which of them is used."""

from __future__ import annotations

import os
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors
from illumcli.rays.pattern_rays import PatternRays, PatternResults
from illumcli.records import Record

RAYS_PER_CALL = 1 << 18
"""An interrupt waits for one call at most."""
NO_LIMIT = F(1e37)
"""Ray length that is passed to Embree for an unlimited ray."""
SWITCH = "ILLUM_PACKETS"
"""Environment variable; 0 turns packets off."""


class Closest(Record):
    """Closest hits of N rays; a miss has triangle -1 and distance inf."""

    triangle: Ids  # (N,)
    u: Floats  # (N,) weight of corner 1
    v: Floats  # (N,) weight of corner 2
    distance: Floats  # (N,) in lengths of the direction

    @classmethod
    def empty(cls, count: int) -> Closest:
        """Uninitialized hits of `count` rays."""
        return cls(np.empty(count, np.int32), np.empty(count, F), np.empty(count, F), np.empty(count, F))


class RayLoop(Protocol):
    """Embree's tree over triangles, and a loop that queries it for arrays of finite rays.

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

    def closest(self, origins: Vectors, directions: Vectors) -> Closest:
        """The closest hit of each ray."""
        ...

    def distance(self, origins: Vectors, directions: Vectors) -> Floats:
        """(N,) distance of each ray's closest hit."""
        ...

    def trace_patterns(self, rays: PatternRays, limit: float, out: PatternResults) -> None:
        """Fill `out`, whose `open` is 0, with the results of rays that are `limit` long."""
        ...


def ray_loop(vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> RayLoop:
    """The fastest loop that is available, over these triangles."""
    if why_no_packets() is None:
        from illumcli.rays.packet_loop import PacketLoop

        return PacketLoop(vertices, triangles)
    from illumcli.rays.single_ray_loop import SingleRayLoop

    return SingleRayLoop(vertices, triangles)


def why_no_packets() -> str | None:
    """Why rays are not traced in packets; None if they are."""
    if os.environ.get(SWITCH) == "0":
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


def batches(count: int) -> list[slice]:
    """The rays of each call."""
    return [slice(first, min(first + RAYS_PER_CALL, count)) for first in range(0, count, RAYS_PER_CALL)]
