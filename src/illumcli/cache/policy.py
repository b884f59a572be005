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
from illumcli.visibility.object_pixels import FittedPixels

LOAD_SECONDS = 0.001
LOAD_RATE = 1e9
"""Assumed time to load and verify a buffer: `LOAD_SECONDS`, and a second per `LOAD_RATE` bytes. Measured
loads are about twice as fast."""

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
    "fitted_obscurance": FittedPixels,
}
"""Types of the buffers of the scene, or of a whole view, that are kept, by name or its part before the colon.

Not kept: Embree's tree, which Embree cannot export, and buffers that are computed from these faster than they
are loaded.
"""
ALWAYS = ("camera",)
"""Buffers kept even if computing them is fast: the keys of a view's buffers depend on the camera's place."""


def worth(seconds: float, size: int) -> bool:
    """True if loading `size` bytes is faster than the `seconds` of one processor that a buffer took, with all
    its inputs."""
    return seconds > LOAD_SECONDS + size / LOAD_RATE


def is_kept(name: str) -> bool:
    """True if buffers of this name may be kept between runs."""
    kind = name.partition(":")[0]
    return kind in CODECS or kind in SCENE_BUFFERS


def is_always_kept(name: str) -> bool:
    """True if a buffer of this name is kept even if computing it is fast."""
    return name.partition(":")[0] in ALWAYS
