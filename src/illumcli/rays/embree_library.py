"""The Embree library that the embreex package ships, called through its documented interface.

References
----------
Embree 4 API manual; include/embree4/rtcore_device.h, rtcore_scene.h, rtcore_geometry.h.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import IllumError

Handle: TypeAlias = int
"""Address of a device, scene or geometry of Embree."""

ROBUST, FILTER_IN_ARGUMENTS = 1 << 2, 1 << 3  # RTC_SCENE_FLAG_ROBUST, _FILTER_FUNCTION_IN_ARGUMENTS
INDEX, VERTEX = 0, 1  # RTC_BUFFER_TYPE_*
UINT3, FLOAT3 = 0x5003, 0x9003  # RTC_FORMAT_*
MATRIX_BY_COLUMNS = 0x9234  # RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR
TRIANGLES, INSTANCE = 0, 121  # RTC_GEOMETRY_TYPE_*
OUT_OF_MEMORY = 4  # RTC_ERROR_OUT_OF_MEMORY
NATIVE_PACKETS = ((16, 34), (8, 33), (4, 32))
"""Widths of packets, with RTC_DEVICE_PROPERTY_NATIVE_RAY*_SUPPORTED, which says whether they are native."""
PACKET_QUERIES = ("rtcIntersect", "rtcOccluded")

PLACES = ("embreex.libs/libembree4*", "embreex/.dylibs/libembree4*", "embreex.libs/embree4*.dll")
"""Where wheels of embreex keep the library, on Linux, macOS and Windows. `importlib.metadata` knows it too,
but its import takes 12 to 28 ms."""


@cache
def embree_library() -> ctypes.CDLL | None:
    """The library that embreex uses, with declared functions; None if there is not exactly one."""
    paths = list(_paths())
    if len(paths) != 1:
        return None
    try:
        library = ctypes.CDLL(str(paths[0]))
        _declare(library)
    except (OSError, AttributeError):
        return None
    return library


def _paths() -> Iterator[Path]:
    spec = find_spec("embreex")
    for folder in spec.submodule_search_locations or () if spec else ():
        for place in PLACES:
            yield from Path(folder).parent.glob(place)


def loaded_library() -> ctypes.CDLL:
    """The library, known to be there."""
    library = embree_library()
    assert library is not None
    return library


def _declare(library: ctypes.CDLL) -> None:
    pointer, number, size = ctypes.c_void_p, ctypes.c_uint, ctypes.c_size_t
    signatures: dict[str, tuple[Any, list[Any]]] = {
        "rtcNewDevice": (pointer, [ctypes.c_char_p]),
        "rtcReleaseDevice": (None, [pointer]),
        "rtcGetDeviceProperty": (ctypes.c_ssize_t, [pointer, number]),
        "rtcGetDeviceError": (ctypes.c_int, [pointer]),
        "rtcSetDeviceErrorFunction": (None, [pointer, pointer, pointer]),
        "rtcNewScene": (pointer, [pointer]),
        "rtcReleaseScene": (None, [pointer]),
        "rtcSetSceneFlags": (None, [pointer, ctypes.c_int]),
        "rtcGetSceneFlags": (ctypes.c_int, [pointer]),
        "rtcGetSceneDevice": (pointer, [pointer]),
        "rtcCommitScene": (None, [pointer]),
        "rtcNewGeometry": (pointer, [pointer, number]),
        "rtcSetNewGeometryBuffer": (pointer, [pointer, number, number, number, size, size]),
        "rtcCommitGeometry": (None, [pointer]),
        "rtcAttachGeometry": (number, [pointer, pointer]),
        "rtcReleaseGeometry": (None, [pointer]),
        "rtcSetGeometryInstancedScene": (None, [pointer, pointer]),
        "rtcSetGeometryTransform": (None, [pointer, number, number, pointer]),
        **{
            f"{query}{width}": (None, 4 * [pointer])
            for query in PACKET_QUERIES
            for width, _ in NATIVE_PACKETS
        },
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments


def build_tree(
    device: Handle,
    scene: Handle,
    vertices: NDArray[np.float32],
    triangles: NDArray[np.int32],
    commit: bool = True,
) -> None:
    """Attach (V, 3) vertices and (T, 3) triangles to a scene and, if `commit`, build its tree.

    The interpreter lock is not held meanwhile.

    Raises
    ------
    MemoryError
        An allocation of Embree failed.
    IllumError
        Embree reports another error.
    """
    library = loaded_library()
    library.rtcGetDeviceError(device)  # the device forgets errors of earlier trees
    if len(triangles):
        _attach(device, scene, vertices, triangles)
    if commit:
        library.rtcCommitScene(scene)
    check(library.rtcGetDeviceError(device))


def check(error: int) -> None:
    """Raise what an error code of a device means, unless it is 0."""
    if error == OUT_OF_MEMORY:
        raise MemoryError
    if error:
        raise IllumError(f"Embree could not build its tree: error {error}")


def _attach(
    device: Handle, scene: Handle, vertices: NDArray[np.float32], triangles: NDArray[np.int32]
) -> None:
    library = loaded_library()
    geometry = library.rtcNewGeometry(device, TRIANGLES)
    if not geometry:  # any call with a null handle ends the process
        raise MemoryError
    try:
        # vertices are 16 bytes apart: Embree reads each with one aligned load
        for kind, form, width, array in ((VERTEX, FLOAT3, 4, vertices), (INDEX, UINT3, 3, triangles)):
            address = library.rtcSetNewGeometryBuffer(geometry, kind, 0, form, 4 * width, len(array))
            if not address:
                raise MemoryError
            memory = (ctypes.c_uint32 * (width * len(array))).from_address(address)
            np.frombuffer(memoryview(memory), array.dtype).reshape(-1, width)[:, :3] = array
        library.rtcCommitGeometry(geometry)
        library.rtcAttachGeometry(scene, geometry)
    finally:
        library.rtcReleaseGeometry(geometry)
