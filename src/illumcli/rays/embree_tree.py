"""Embree's tree over triangles and instances, built through its documented interface.

References
----------
Embree 4 API manual: rtcNewGeometry, rtcSetGeometryInstancedScene, rtcSetGeometryTransform.
"""

from __future__ import annotations

import ctypes
import weakref
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.rays.embree_library import (
    FILTER_IN_ARGUMENTS,
    INSTANCE,
    MATRIX_BY_COLUMNS,
    NATIVE_PACKETS,
    ROBUST,
    Handle,
    build_tree,
    check,
    loaded_library,
)
from illumcli.rays.ray_loop import InstancedMeshes


@cache
def device() -> Handle:
    """The device of all trees of this process, which can make about a thousand devices."""
    library = loaded_library()
    device: Handle | None = library.rtcNewDevice(None)
    if not device:
        check(library.rtcGetDeviceError(None))
        raise MemoryError
    return device


@cache
def native_widths() -> tuple[int, ...]:
    """Rays per packet that Embree has kernels for on this processor, the widest first."""
    library = loaded_library()
    return tuple(w for w, known in NATIVE_PACKETS if library.rtcGetDeviceProperty(device(), known))


class EmbreeTree:
    """A scene of Embree: triangles, then instances, whose numbers begin at `first_instance`."""

    def __init__(
        self,
        vertices: NDArray[np.float32],
        triangles: NDArray[np.int32],
        instanced: InstancedMeshes | None = None,
    ) -> None:
        self.scene = _new_scene()
        weakref.finalize(self, loaded_library().rtcReleaseScene, self.scene)
        self.first_instance = 1 if len(triangles) else 0
        self.has_instances = instanced is not None
        build_tree(device(), self.scene, vertices, triangles, commit=instanced is None)
        if instanced is not None:
            _add_instances(self.scene, instanced)


def _new_scene() -> Handle:
    library = loaded_library()
    scene: Handle | None = library.rtcNewScene(device())
    if not scene:
        raise MemoryError
    library.rtcSetSceneFlags(scene, ROBUST | FILTER_IN_ARGUMENTS)
    return scene


def _add_instances(scene: Handle, instanced: InstancedMeshes) -> None:
    """Attach all instances to a scene, and build its tree."""
    library, meshes = loaded_library(), []
    try:
        for vertices, triangles in zip(instanced.vertices, instanced.triangles, strict=True):
            meshes.append(_new_scene())
            build_tree(device(), meshes[-1], vertices, triangles)
        by_columns = np.ascontiguousarray(instanced.matrix.transpose(0, 2, 1))
        for mesh, matrix in zip(instanced.mesh.tolist(), by_columns, strict=True):
            _add_instance(scene, meshes[mesh], matrix.ctypes.data_as(ctypes.c_void_p))
    finally:
        for mesh in meshes:  # an instance keeps its mesh alive
            library.rtcReleaseScene(mesh)
    library.rtcCommitScene(scene)
    check(library.rtcGetDeviceError(device()))


def _add_instance(scene: Handle, mesh: Handle, matrix: Any) -> None:
    library = loaded_library()
    geometry = library.rtcNewGeometry(device(), INSTANCE)
    if not geometry:
        raise MemoryError
    library.rtcSetGeometryInstancedScene(geometry, mesh)
    library.rtcSetGeometryTransform(geometry, 0, MATRIX_BY_COLUMNS, matrix)
    library.rtcCommitGeometry(geometry)
    library.rtcAttachGeometry(scene, geometry)
    library.rtcReleaseGeometry(geometry)
