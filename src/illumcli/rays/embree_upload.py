"""Triangles into an embreex scene, in one copy.

embreex.TriangleMesh copies element by element through Python objects, 1.3 s per million triangles. The Embree
library that embreex ships takes whole arrays, 3 ms per million, but needs the scene's handle, which is a
private field of the EmbreeScene object. The field's offset is verified each time before it is used: the
public field next to it is written and read back from memory, and Embree is asked for the scene's flags. If
anything is not as expected, `TriangleMesh` is used instead.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.rays.embree_library import ROBUST, Handle, build_tree, embree_library

HANDLE, COMMITTED, SIZE = 16, 24, 40
"""Offsets of the scene's handle and of `is_committed` in an EmbreeScene, and the object's size [bytes]."""


def upload(scene: Any, vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> None:
    """Attach (V, 3) vertices and (T, 3) triangles to an EmbreeScene that is not committed yet.

    The tree is built at once and without holding the interpreter lock, as embreex would.
    """
    library = embree_library()
    handle = _handle(scene) if library else None
    if library is None or handle is None or library.rtcGetSceneFlags(handle) != ROBUST:
        from embreex.mesh_construction import TriangleMesh

        TriangleMesh(scene, np.ascontiguousarray(vertices), np.ascontiguousarray(triangles))
        return
    device = library.rtcGetSceneDevice(handle)
    # embreex's error callback needs the interpreter lock, which these calls do not hold
    library.rtcSetDeviceErrorFunction(device, None, None)
    try:
        build_tree(device, handle, vertices, triangles)
    finally:
        library.rtcReleaseDevice(device)
    scene.is_committed = 1


def _handle(scene: Any) -> Handle | None:
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
