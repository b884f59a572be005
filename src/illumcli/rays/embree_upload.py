"""Triangles into an embreex scene, in one copy.

embreex.TriangleMesh copies element by element through Python objects, 1.3 s per million triangles. The Embree
library that embreex ships takes whole arrays, 3 ms per million, but needs the scene's handle, which is a
private field of the EmbreeScene object. The field's offset is verified each time before it is used: the
public field next to it is written and read back from memory, and Embree is asked for the scene's flags. If
anything is not as expected, `TriangleMesh` is used instead.
"""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import IllumError

HANDLE, COMMITTED, SIZE = 16, 24, 40
"""Offsets of the scene's handle and of `is_committed` in an EmbreeScene, and the object's size [bytes]."""
ROBUST = 4  # RTC_SCENE_FLAG_ROBUST
INDEX, VERTEX = 0, 1  # RTC_BUFFER_TYPE_*
UINT3, FLOAT3 = 0x5003, 0x9003  # RTC_FORMAT_*
TRIANGLES = 0  # RTC_GEOMETRY_TYPE_TRIANGLE
OUT_OF_MEMORY = 4  # RTC_ERROR_OUT_OF_MEMORY


def upload(scene: Any, vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> None:
    """Attach (V, 3) vertices and (T, 3) triangles to an EmbreeScene that is not committed yet.

    The tree is built at once and without holding the interpreter lock, as embreex would.
    """
    library = _library()
    handle = _handle(scene) if library else None
    if library is None or handle is None or library.rtcGetSceneFlags(handle) != ROBUST:
        from embreex.mesh_construction import TriangleMesh

        TriangleMesh(scene, np.ascontiguousarray(vertices), np.ascontiguousarray(triangles))
        return
    device = library.rtcGetSceneDevice(handle)
    # embreex's error callback needs the interpreter lock, which these calls do not hold
    library.rtcSetDeviceErrorFunction(device, None, None)
    try:
        _commit(library, device, handle, vertices, triangles)
        error = library.rtcGetDeviceError(device)
    finally:
        library.rtcReleaseDevice(device)
    if error == OUT_OF_MEMORY:
        raise MemoryError
    if error:
        raise IllumError(f"Embree could not build its tree: error {error}")
    scene.is_committed = 1


def _commit(
    library: Any, device: int, handle: int, vertices: NDArray[np.float32], triangles: NDArray[np.int32]
) -> None:
    """Attach the triangles to Embree's scene and build it; MemoryError where an allocation fails."""
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
        library.rtcAttachGeometry(handle, geometry)
    finally:
        library.rtcReleaseGeometry(geometry)
    library.rtcCommitScene(handle)


def _handle(scene: Any) -> int | None:
    """Embree's handle of an EmbreeScene; None if the object's layout is not as expected."""
    if type(scene).__basicsize__ != SIZE or scene.is_committed:
        return None
    flag = ctypes.c_int.from_address(id(scene) + COMMITTED)
    for probe in (0x5AFE, 0):
        scene.is_committed = probe
        if flag.value != probe:
            scene.is_committed = 0
            return None
    handle = ctypes.c_void_p.from_address(id(scene) + HANDLE).value
    if handle is None:  # Embree could not allocate the scene, which embreex does not check
        raise MemoryError
    return handle


@cache
def _library() -> Any:
    """The Embree library that embreex loaded, with declared functions; None if there is not exactly one."""
    import embreex

    libraries = sorted(Path(embreex.__file__).parent.parent.glob("embreex.libs/libembree4*"))
    if len(libraries) != 1:
        return None
    library = ctypes.CDLL(str(libraries[0]))
    pointer, number, size = ctypes.c_void_p, ctypes.c_uint, ctypes.c_size_t
    signatures = {
        "rtcGetSceneFlags": (ctypes.c_int, [pointer]),
        "rtcGetSceneDevice": (pointer, [pointer]),
        "rtcNewGeometry": (pointer, [pointer, number]),
        "rtcSetNewGeometryBuffer": (pointer, [pointer, number, number, number, size, size]),
        "rtcCommitGeometry": (None, [pointer]),
        "rtcAttachGeometry": (number, [pointer, pointer]),
        "rtcSetDeviceErrorFunction": (None, [pointer, pointer, pointer]),
        "rtcCommitScene": (None, [pointer]),
        "rtcGetDeviceError": (ctypes.c_int, [pointer]),
        "rtcReleaseGeometry": (None, [pointer]),
        "rtcReleaseDevice": (None, [pointer]),
    }
    try:
        for name, (result, arguments) in signatures.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
    except AttributeError:
        return None
    return library
