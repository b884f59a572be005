"""The grain of surfaces: tangents that orient anisotropic materials, such as brushed metal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeAlias

import numpy as np

from illumcli.arrays import Vectors, take_rows, unit
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry
from illumcli.rays.corner_weights import CornerWeights
from illumcli.rays.interaction import rings, tangent
from illumcli.shading.rates import ShadingPoints


class Rings(Protocol):
    """Grain that runs about an axis (`scene.spec.Rings`)."""

    @property
    def axis(self) -> tuple[float, float, float]: ...
    @property
    def centre(self) -> tuple[float, float, float]: ...


Grain: TypeAlias = tuple[float, float, float] | Rings
"""A direction, or circles about an axis, in object space."""


def tangents(
    grains: Sequence[Grain | None],
    geometry: SceneGeometry,
    points: ShadingPoints,
    point_weights: CornerWeights | None = None,
    uv_tangents: CornerVectors | None = None,
) -> Vectors:
    """(E, 3) float32 unit tangents: the grain of each object, or the direction of increasing u.

    Parameters
    ----------
    grains : sequence
        One for each object; None for the direction of increasing u.
    point_weights, uv_tangents : optional
        Needed if some object's grain is None.
    """
    # The direction of increasing u, or zero.
    if uv_tangents is None or point_weights is None:
        direction = np.zeros_like(points.n)
    else:
        direction = geometry.unit_directions(points.objects, point_weights.interpolate(geometry, uv_tangents))

    # Replace it on the objects that have a grain of their own.
    for i in np.flatnonzero(np.bincount(points.objects)).tolist():
        grain, matrix = grains[i], geometry.matrices[i]
        if grain is None:
            continue
        index = np.flatnonzero(points.objects == i)
        linear = matrix[:3, :3] / np.abs(matrix[:3, :3]).max()
        if isinstance(grain, tuple):
            along = linear @ (np.asarray(grain) / np.abs(grain).max())
            direction[index] = along / (np.linalg.norm(along) or 1.0)
        else:
            centre = geometry.render_space.from_world(matrix[:3, :3] @ grain.centre + matrix[:3, 3])
            direction[index] = rings(linear, grain.axis, centre, take_rows(points.position, index))
    return tangent(points.n, unit(direction))
