"""Shadows: delta(p, j), by a shadow ray from each sample that light j may reach.

A shadow ray starts on the polygon. Where polygons approximate a smooth surface this causes the shadow
terminator problem: polygons on the lit side of the surface that face away from the light, or are hidden by
their neighbours, would be in shadow. So if the ray of a sample is blocked, a second ray starts from the
smooth surface that the normals imply. It must not skip an occluder: the segment to its origin must be
unoccluded, and nothing but the surface itself may be nearby in the light's direction.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, column_major, dot, length, take_rows, unit
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry
from illumcli.geometry.smooth_parts import SmoothParts
from illumcli.lights._incident import LitPoints
from illumcli.rays.corner_weights import Corners, CornerWeights
from illumcli.rays.embree import Tracer
from illumcli.rays.interaction import ShadingContext, SurfaceInteraction, facing
from illumcli.rays.offsets import bounded, offset_ray_origins, to_tangent_plane
from illumcli.records import Record

TERMINATOR_SHARE = 1 / 3
"""Upper bound on the terminator offset, in diagonals of the polygon's bounding box, against arbitrary
normals. A sphere from a cube's faces needs up to 0.24, from an octahedron's 0.27, finer spheres less."""
NEARBY = 2.0
"""Distance, in such diagonals, within which anything but the same smooth surface shadows a sample."""


class SmoothSurface(Record):
    """The samples of a tile, with the normals that imply a smooth surface at each."""

    context: ShadingContext
    normals: CornerVectors
    parts: SmoothParts
    flat: NDArray[np.bool_]  # (O,) True for objects whose shadow rays start on their polygons


def smooth_surface(
    flat: Sequence[bool], shading_context: ShadingContext, smooth_parts: SmoothParts
) -> SmoothSurface:
    """The samples with the smooth surface that their normals imply; `flat` objects have none."""
    assert shading_context.normals is not None
    return SmoothSurface(shading_context, shading_context.normals, smooth_parts, np.array(flat, np.bool_))


def ray_origins(interaction: SurfaceInteraction) -> Vectors:
    """(M, 3) float32 origins of shadow and obscurance rays, offset from the triangle by rounding errors."""
    return offset_ray_origins(interaction.position, interaction.ng, interaction.edge)


def shadow(
    tracer: Tracer,
    ray_origins: Vectors,
    shadow_candidates: LitPoints,
    smooth_surface: SmoothSurface | None = None,
) -> NDArray[np.float32]:
    """(M,) delta of one light: 1 where it is unoccluded, 0 in shadow and on samples that it cannot reach.

    With `smooth_surface`, which holds the same samples, the shadow terminator is corrected.
    """
    # One shadow ray for each sample that the light may reach.
    lit, smooth = shadow_candidates, smooth_surface
    delta = np.zeros(lit.count, F)
    origins = column_major(take_rows(ray_origins, lit.index))
    hidden = tracer.occluded(origins, lit.l, lit.distance, coherent=True)

    # A second one, from the implied surface, where it is blocked.
    if smooth is not None and (blocked := np.flatnonzero(hidden)).size:
        sample = lit.index.take(blocked)
        l, distance = column_major(take_rows(lit.l, blocked)), lit.distance.take(blocked)
        hidden[blocked] = ~_lit_on_implied_surface(tracer, smooth, ray_origins, sample, l, distance)
    delta[lit.index] = ~hidden
    return delta


def _lit_on_implied_surface(
    tracer: Tracer, smooth: SmoothSurface, origins: Vectors, sample: Ids, l: Vectors, distance: Floats
) -> NDArray[np.bool_]:
    """(B,) True for samples whose own ray is blocked, but which the light reaches on the implied surface."""
    # The offset from each sample to the implied surface; it is 0 on flat polygons and objects.
    interaction, geometry = smooth.context.interaction, smooth.context.geometry
    weights = smooth.context.weights.take(sample)
    position = take_rows(interaction.position, sample)
    width = _box_diagonals(geometry, weights)
    offset = _terminator_offset(
        smooth, weights, column_major(position, F), interaction.back_facing.take(sample)
    )
    offset = bounded(offset, TERMINATOR_SHARE * width)
    objects = weights.hits.objects
    flat = smooth.flat.take(objects)
    curved = np.flatnonzero((length(offset) > 0) & ~flat)

    # Keep the samples whose shadow ray from there is unoccluded, as is the segment to the ray's origin.
    ng, edge = take_rows(interaction.ng, sample.take(curved)), interaction.edge.take(sample.take(curved))
    starts = offset_ray_origins(_at(position, curved) + _at(offset, curved), ng, edge)
    curved = curved[~tracer.occluded(starts, _at(l, curved), _at(distance, curved), coherent=True)]
    height = length(_at(offset, curved))
    on_polygon = column_major(take_rows(origins, sample.take(curved)))
    curved = curved[~tracer.occluded(on_polygon, column_major(_at(offset, curved) / height[:, None]), height)]

    # Anything nearby in the light's direction shadows the sample, except the surface itself.
    on_polygon, ng = (
        column_major(take_rows(origins, sample.take(curved))),
        take_rows(interaction.ng, sample.take(curved)),
    )
    hit = tracer.closest(on_polygon, _above(_at(l, curved), ng))
    near = np.minimum(NEARBY * _at(width, curved), _at(distance, curved))
    is_surface = (hit.triangle >= 0) & (
        geometry.objects_of(hit.triangle, hit.instance) == objects.take(curved)
    )
    same = np.flatnonzero(is_surface)
    own = weights.hits.triangle.take(curved).take(same)
    is_surface[same] = smooth.parts.are_joined(own, hit.triangle.take(same))
    reached = np.zeros(len(sample), np.bool_)
    reached[curved[(hit.distance >= near) | is_surface]] = True
    return reached


def _terminator_offset(
    smooth: SmoothSurface, weights: CornerWeights, position: Vectors, back_facing: NDArray[np.bool_]
) -> Vectors:
    """(B, 3) offset of samples on polygons to the smooth surface that the normals at the corners imply."""
    geometry, normals = smooth.context.geometry, smooth.normals

    def corner_offset(group: Corners, k: int) -> Vectors:
        normal, corner = group.normal(geometry, normals, k), group.position(geometry, k)
        if group.index is None:
            return to_tangent_plane(position, corner, facing(normal, back_facing))
        return to_tangent_plane(
            take_rows(position, group.index), corner, facing(normal, back_facing.take(group.index))
        )

    return weights.weighted_mean(corner_offset)


def _box_diagonals(geometry: SceneGeometry, weights: CornerWeights) -> Floats:
    """(B,) diagonal of the bounding box of each sample's polygon [radii]."""
    out = np.empty(len(weights), F)
    for group in weights.groups:
        corners = [group.position(geometry, k) for k in range(group.count)]
        size = length(np.maximum.reduce(corners) - np.minimum.reduce(corners))
        out[slice(None) if group.index is None else group.index] = size
    return out


def _at(values: NDArray[Any], index: NDArray[np.intp]) -> NDArray[Any]:
    return column_major(take_rows(values, index))


def _above(l: Vectors, ng: Vectors) -> Vectors:
    """(N, 3) float32 `l`, projected onto the polygon's plane where it points below it."""
    below = np.minimum(dot(l, ng), 0)
    return column_major(unit(l - below[:, None] * ng), F)
