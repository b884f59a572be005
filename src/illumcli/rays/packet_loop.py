"""Ray queries in packets of rays: a C loop (`packets.c`) that calls the Embree library of embreex.

Its results have the same bits as those of embreex's loop, which is used without it (`illumcli.compiled`).

Embree's incoherent mode traverses each ray of a packet alone. Its coherent mode takes half of the time for
camera rays, but which of two triangles at almost the same distance is hit then depends on the other rays. So
the loop notes rays that met two such triangles, and these are traced again, alone.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors, take_rows
from illumcli.compiled import CVectors, compiled_library, declare
from illumcli.rays.embree_library import embree_library, loaded_library
from illumcli.rays.embree_tree import EmbreeTree, native_widths
from illumcli.rays.pattern_rays import CompactTable, PatternRays, PatternResults
from illumcli.rays.ray_loop import NO_LIMIT, RAYS_PER_CALL, Closest, InstancedMeshes, batches

INTERFACE = 4
"""Version of the interface of `packets.c`; a library with another one is not used."""

_NO_LIMIT = np.asarray(NO_LIMIT)


class _Arguments(ctypes.Structure):
    """RTCOccludedArguments, with room for what other versions of Embree add."""

    _fields_ = (("flags", ctypes.c_uint), ("feature_mask", ctypes.c_uint), ("rest", ctypes.c_void_p * 6))


COHERENT = _Arguments(1 << 16, 0xFFFFFFFF)
"""RTC_RAY_QUERY_FLAG_COHERENT, for occlusion. Rays from a picture's points to a light take 40 % less
time with it, rays in all directions up to twice as long. With instances the answers change in some rays."""


class _Query(ctypes.Structure):
    _fields_ = (
        ("function", ctypes.c_void_p),
        ("scene", ctypes.c_void_p),
        ("arguments", ctypes.c_void_p),
        ("width", ctypes.c_int64),
    )


class _Rays(ctypes.Structure):
    _fields_ = (
        ("query", _Query),
        ("first", ctypes.c_int64),
        ("end", ctypes.c_int64),
        ("rays_per_origin", ctypes.c_int64),
        ("origins", CVectors),
        ("directions", CVectors),
        ("limits", ctypes.c_void_p),
        ("limit_stride", ctypes.c_int64),
    )


class _Patterns(ctypes.Structure):
    _fields_ = (
        ("query", _Query),
        ("first", ctypes.c_int64),
        ("end", ctypes.c_int64),
        ("samples", ctypes.c_int64),
        ("origins_per_point", ctypes.c_int64),
        ("frames", ctypes.c_void_p),
        ("patterns", ctypes.c_void_p),
        ("row", ctypes.c_void_p),
        ("number", ctypes.c_void_p),
        ("origin_of_ray", ctypes.c_void_p),
        ("first_mirrored", ctypes.c_void_p),
        ("origins", CVectors),
        ("normals", CVectors),
        ("limit", ctypes.c_float),
        ("least_height", ctypes.c_float),
    )


class _PatternResults(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("open", "is_open", "distance", "directions")),
        ("stride", ctypes.c_int64),
    )


class _Hits(ctypes.Structure):
    _fields_ = tuple(
        (name, ctypes.c_void_p) for name in ("triangle", "instance", "u", "v", "distance", "doubtful")
    )


@cache
def packet_library() -> ctypes.CDLL | None:
    """The compiled loop, a ctypes.CDLL; None if it is missing or has another interface."""
    library = compiled_library(__file__, "packets", INTERFACE)
    if library is None:
        return None
    declare(
        library,
        occluded=[ctypes.POINTER(_Rays), ctypes.c_void_p],
        closest=[ctypes.POINTER(_Rays), ctypes.POINTER(_Hits)],
        patterns=[ctypes.POINTER(_Patterns), ctypes.POINTER(_PatternResults)],
    )
    return library


def missing() -> str | None:
    """What packets lack here; None if nothing."""
    if packet_library() is None:
        return "no compiled loop"
    if embree_library() is None:
        return "no Embree library found in embreex"
    return None if native_widths() else "the processor has no native packets"


class PacketLoop:
    """Packets of `width` rays, by default the widest that is native; 1 is a loop over single rays."""

    def __init__(
        self,
        vertices: NDArray[np.float32],
        triangles: NDArray[np.int32],
        width: int | None = None,
        instanced: InstancedMeshes | None = None,
    ) -> None:
        loop = packet_library()
        assert loop is not None
        self._loop = loop
        self.width = native_widths()[0] if width is None else width
        self._tree = EmbreeTree(vertices, triangles, instanced)

    def occluded(
        self, origins: Vectors, directions: Vectors, limits: Floats, coherent: bool = False
    ) -> NDArray[np.bool_]:
        out = np.empty(len(directions), np.bool_)
        rays = self._rays("rtcOccluded", origins, directions, limits)
        if coherent and self._traces_together:
            rays.query.arguments = ctypes.addressof(COHERENT)
        for part in batches(len(directions)):
            rays.first, rays.end = part.start, part.stop
            self._loop.illum_occluded(rays, out.ctypes.data)
        return out

    @property
    def _traces_together(self) -> bool:
        """True if coherent rays are traced in Embree's coherent mode."""
        return self.width > 1 and not self._tree.has_instances

    def closest(self, origins: Vectors, directions: Vectors, coherent: bool = False) -> Closest:
        hits = Closest.empty(len(directions))
        places = _Hits(**{name: array.ctypes.data for name, array in vars(hits).items()})
        if coherent and self._traces_together:
            doubtful = np.empty(len(directions), np.bool_)
            places.doubtful = doubtful.ctypes.data
            self._intersect(origins, directions, places)
            again = np.flatnonzero(doubtful)
            each = len(directions) // max(len(origins), 1) or 1
            hits.replace(again, self.closest(take_rows(origins, again // each), take_rows(directions, again)))
            return hits
        self._intersect(origins, directions, places)
        if self._tree.first_instance:
            np.subtract(hits.instance, hits.instance >= 0, out=hits.instance)  # the triangles are geometry 0
        return hits

    def distance(self, origins: Vectors, directions: Vectors) -> Floats:
        out = np.empty(len(directions), F)
        self._intersect(origins, directions, _Hits(distance=out.ctypes.data))
        return out

    def _intersect(self, origins: Vectors, directions: Vectors, hits: _Hits) -> None:
        rays = self._rays("rtcIntersect", origins, directions, _NO_LIMIT)
        for part in batches(len(directions)):
            rays.first, rays.end = part.start, part.stop
            self._loop.illum_closest(rays, hits)

    def trace_patterns(self, rays: PatternRays, limit: float, out: PatternResults) -> None:
        # The rays of the points as the C loop takes them; `arrays` must outlive the calls.
        points, samples = rays.shape
        patterns = rays.patterns
        compact = patterns.compact or CompactTable(patterns.table, np.arange(samples, dtype=np.int32))
        arrays = {
            "frames": rays.frames,
            "patterns": compact.table,
            "row": patterns.row,
            "number": compact.number,
            "origin_of_ray": rays.origin_of_ray.take(compact.number),
            "first_mirrored": rays.first_mirrored,
        }
        structure = _Patterns(
            query=self._query("rtcOccluded" if out.distance is None else "rtcIntersect"),
            samples=samples,
            origins_per_point=rays.origins_per_point,
            origins=CVectors.of(rays.origins),
            limit=limit,
            least_height=rays.least_height,
            **{name: _address_of(array) for name, array in arrays.items()},
        )
        if rays.normals is not None:
            structure.normals = CVectors.of(rays.normals)

        # The arrays to fill.
        wanted = {name: _address_of(array) for name, array in vars(out).items() if array is not None}
        results = _PatternResults(**wanted, stride=points * samples)

        # Trace a few points per call.
        per_call = max(1, RAYS_PER_CALL // max(samples, 1))
        for first in range(0, points, per_call):
            structure.first, structure.end = first, min(first + per_call, points)
            self._loop.illum_patterns(structure, results)

    def _query(self, name: str) -> _Query:
        return _Query(_address(f"{name}{self.width}"), self._tree.scene, None, self.width)

    def _rays(self, query: str, origins: Vectors, directions: Vectors, limits: Floats) -> _Rays:
        """The rays as the C loop takes them; the arrays must outlive it."""
        count = len(directions)
        return _Rays(
            query=self._query(query),
            rays_per_origin=count // max(len(origins), 1) or 1,
            origins=CVectors.of(origins),
            directions=CVectors.of(directions),
            limits=limits.ctypes.data,
            limit_stride=1 if limits.ndim else 0,
        )


def _address_of(array: NDArray[Any]) -> int:
    """Address of an array that the C loop reads or writes in C order."""
    assert array.flags.c_contiguous
    return array.ctypes.data


@cache
def _address(name: str) -> int | None:
    """Where a function of Embree is in memory."""
    return ctypes.cast(getattr(loaded_library(), name), ctypes.c_void_p).value
