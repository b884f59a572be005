"""Camera rays and surface interactions by a loop in C (`samples.c`), in a third of numpy's time."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors
from illumcli.compiled import CVectors, compiled_loop, declare
from illumcli.geometry.scene_geometry import CornerVectors

INTERFACE = 3
"""Version of the interface of `samples.c`; a library with another one is not used."""


class _Pinhole(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_double * 3) for name in ("right", "up", "forward", "eye")),
        *((name, ctypes.c_double) for name in ("right_eye", "up_eye", "forward_eye")),
        *((name, ctypes.c_double) for name in ("slope", "width", "height")),
    )


class _SurfaceHits(ctypes.Structure):
    _fields_ = (
        *((name, CVectors) for name in ("vertices", "triangles", "towards_eye")),
        *((name, ctypes.c_void_p) for name in ("triangle", "u", "v")),
        ("count", ctypes.c_int64),
    )


class _Surface(ctypes.Structure):
    _fields_ = tuple((name, ctypes.c_void_p) for name in ("position", "ng", "edge", "back_facing"))


class _NormalHits(ctypes.Structure):
    _fields_ = (
        *((name, CVectors) for name in ("corners", "values")),
        ("index", ctypes.c_void_p),
        *((name, ctypes.c_int64) for name in ("rows", "count")),
        *((name, ctypes.c_void_p) for name in ("triangle", "u", "v", "ng", "back_facing")),
    )


class SampleLoop:
    """The compiled loop."""

    def __init__(self, library: ctypes.CDLL) -> None:
        address, size = ctypes.c_void_p, ctypes.c_int64
        declare(
            library,
            camera_rays=[ctypes.POINTER(_Pinhole), address, size, address, address, address],
            surface=[ctypes.POINTER(_SurfaceHits), ctypes.POINTER(_Surface)],
            ray_origins=[address, address, address, size, address],
            normals=[ctypes.POINTER(_NormalHits), address],
        )
        self._library = library

    def camera_rays(
        self, pinhole: Mapping[str, Any], points: NDArray[np.float64]
    ) -> tuple[Vectors, Vectors, Floats]:
        """Origins, directions and distances of the starts of rays through (N, 2) film positions.

        Parameters
        ----------
        pinhole : mapping
            The values of `Pinhole` in `samples.c`, vectors as (3,) arrays.
        """
        count, points = len(points), np.asfortranarray(points)
        origins, directions = (np.empty((count, 3), F, order="F") for _ in range(2))
        start_distance = np.empty(count)
        camera = _Pinhole(
            **{
                name: tuple(value) if isinstance(value, np.ndarray) and value.ndim else float(value)
                for name, value in pinhole.items()
            }
        )
        self._library.illum_camera_rays(
            camera,
            points.ctypes.data,
            count,
            origins.ctypes.data,
            directions.ctypes.data,
            start_distance.ctypes.data,
        )
        return origins, directions, start_distance

    def surface(
        self,
        vertices: Vectors,
        triangles: NDArray[np.int32],
        hits: tuple[Ids, Floats, Floats],
        towards_eye: Vectors,
    ) -> tuple[NDArray[np.float64], Vectors, Floats, NDArray[np.bool_]]:
        """Positions, normals, effective edges, and which hits are on the back of their triangle.

        Parameters
        ----------
        hits
            Triangle, u and v of each, float32.
        towards_eye : (M, 3) float32
        """
        count = len(towards_eye)
        contiguous = [*map(np.ascontiguousarray, hits)]
        out = (
            np.empty((count, 3), order="F"),
            np.empty((count, 3), F, order="F"),
            np.empty(count, F),
            np.empty(count, np.bool_),
        )
        given = _SurfaceHits(
            *map(CVectors.of, (vertices, triangles, towards_eye)),
            *(array.ctypes.data for array in contiguous),
            count,
        )
        self._library.illum_surface(given, _Surface(*(array.ctypes.data for array in out)))
        return out

    def normals(
        self,
        corners: NDArray[np.int32],
        normals: CornerVectors,
        hits: tuple[Ids, Floats, Floats],
        ng: Vectors,
        back_facing: NDArray[np.bool_],
    ) -> Vectors:
        """(M, 3) unit normals of hits, interpolated between the corners of triangles, on the eye's side.

        Parameters
        ----------
        corners : (T, 3) int32
            Of each triangle.
        hits
            Triangle, u and v of each, float32.
        ng : (M, 3) float32
            Unit normals of the triangles, where the interpolated ones vanish; in Fortran order.
        """
        out = np.empty(ng.shape, F, order="F")
        contiguous = [np.ascontiguousarray(array) for array in (normals.index, *hits, back_facing)]
        index, *others = (array.ctypes.data for array in contiguous)
        triangle, u, v, back = others
        given = _NormalHits(
            *map(CVectors.of, (corners, normals.values)),
            *(index, len(normals.values), len(ng)),
            *(triangle, u, v, ng.ctypes.data, back),
        )
        self._library.illum_normals(given, out.ctypes.data)
        return out

    def ray_origins(self, position: NDArray[np.float64], ng: Vectors, edge: Floats) -> Vectors:
        """(N, 3) origins of rays above triangles; vectors in Fortran order."""
        out = np.empty(ng.shape, F, order="F")
        arrays = position, ng, edge
        self._library.illum_ray_origins(*(array.ctypes.data for array in arrays), len(ng), out.ctypes.data)
        return out


def sample_loop() -> SampleLoop | None:
    """The compiled loop, if there is one and it is not switched off."""
    return compiled_loop(SampleLoop, __file__, "samples", INTERFACE)
