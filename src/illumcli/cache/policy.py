"""Which buffers are kept between runs, and when it is worth keeping one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from illumcli.cache.codec import CODECS
from illumcli.geometry.bounds import ObjectBounds
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.planar import PlanarPolygons
from illumcli.geometry.repairs import MeshRepairs
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry
from illumcli.shading.materials import Numbering

LOAD_SECONDS = 0.001
LOAD_RATE = 1e9
"""Loading a buffer is taken to last `LOAD_SECONDS` and a second per `LOAD_RATE` bytes, checksum included:
about half as fast as measured."""

SCENE_BUFFERS: Mapping[str, type | tuple[type, ...]] = {
    "mesh": Mesh,
    "object_bounds": ObjectBounds,
    "planar_polygons": (PlanarPolygons, type(None)),
    "curved_polygons": (PlanarPolygons, type(None)),
    "camera": tuple,
    "implied_widths": np.ndarray,
    "geometry": SceneGeometry,
    "repairs": MeshRepairs,
    "undirected": MeshRepairs,
    "unnamed": MeshRepairs,
    "corner_normals": CornerVectors,
    "numbering": Numbering,
}
"""Buffers of the whole scene that are kept, by name or by its part before the colon, and their types.

Not kept: the Embree tree, which Embree does not give away, and what is computed from these faster than it is
loaded.
"""
ALWAYS = ("camera",)
"""Kept whatever they took: the keys of a view's buffers depend on the camera's place."""


def worth(seconds: float, size: int) -> bool:
    """Is it worth keeping what took `seconds` of one processor, with all its inputs, and has `size` bytes?"""
    return seconds > LOAD_SECONDS + size / LOAD_RATE


def is_kept(name: str) -> bool:
    """Is a buffer of this name ever kept between runs?"""
    kind = name.partition(":")[0]
    return kind in CODECS or kind in SCENE_BUFFERS


def is_always_kept(name: str) -> bool:
    """Is a buffer of this name kept even where computing it takes no time?"""
    return name.partition(":")[0] in ALWAYS
