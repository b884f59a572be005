"""Occlusion of lights: delta(p, j), asked by shadow rays for the samples that a light may reach.

A shadow ray starts on the polygon. Where polygons stand for a smooth surface that is a false terminator: on
the lit side of the surface, polygons that face away from the light, or hide behind their neighbours, would be
in shadow. So a sample whose own ray is blocked asks again from the surface that its normals imply. That ray
must not jump over anything: the way to its start must be free, and nothing but the surface itself may stand
nearby in the light's direction.
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
"""Of the diagonal of a polygon's bounding box: how far off it a shadow ray may start at most; normals may say
anything. A sphere wants up to 0.24 (a cube's faces) or 0.27 (an octahedron's), finer ones less."""
NEARBY = 2.0
"""Such diagonals within which whatever is not part of the same smooth surface shadows a sample."""


class SmoothSurface(Record):
    """The samples of a tile on the smooth surfaces that their normals imply."""

    context: ShadingContext
    normals: CornerVectors
    parts: SmoothParts
    flat: NDArray[np.bool_]  # (O,) objects whose shadow rays start on their polygons


def smooth_surface(
    flat: Sequence[bool], shading_context: ShadingContext, smooth_parts: SmoothParts
) -> SmoothSurface:
    """The samples on the surface that their normals imply; those of `flat` objects stay on their polygons."""
    assert shading_context.normals is not None
    return SmoothSurface(shading_context, shading_context.normals, smooth_parts, np.array(flat, np.bool_))


def ray_origins(interaction: SurfaceInteraction) -> Vectors:
    """(M, 3) float32 where shadow and obscurance rays start: on the facet, off it by rounding alone."""
    return offset_ray_origins(interaction.position, interaction.ng, interaction.edge)


def shadow(
    tracer: Tracer,
    ray_origins: Vectors,
    shadow_candidates: LitPoints,
    smooth_surface: SmoothSurface | None = None,
) -> NDArray[np.float32]:
    """(M,) delta of one light: 1 where it arrives, 0 in shadow and on samples that it does not reach.

    With `smooth_surface` a false terminator is taken away; the samples are then those of its tile.
    """
    lit, smooth = shadow_candidates, smooth_surface
    delta = np.zeros(lit.count, F)
    hidden = tracer.occluded(column_major(take_rows(ray_origins, lit.index)), lit.l, lit.distance)
    if smooth is not None and (blocked := np.flatnonzero(hidden)).size:
        sample = lit.index.take(blocked)
        l, distance = column_major(take_rows(lit.l, blocked)), lit.distance.take(blocked)
        hidden[blocked] = ~_implied_reached(tracer, smooth, ray_origins, sample, l, distance)
    delta[lit.index] = ~hidden
    return delta


def _implied_reached(
    tracer: Tracer, smooth: SmoothSurface, origins: Vectors, sample: Ids, l: Vectors, distance: Floats
) -> NDArray[np.bool_]:
    """(B,) True for samples whose own ray is blocked, but which the light reaches on the implied surface."""
    # Where the implied surface lies above each sample; on flat polygons and objects it is the polygon itself.
    interaction, geometry = smooth.context.interaction, smooth.context.geometry
    weights = smooth.context.weights.take(sample)
    position = take_rows(interaction.position, sample)
    width = _box_diagonals(geometry, weights)
    offset = _terminator_offset(
        smooth, weights, column_major(position, F), interaction.back_facing.take(sample)
    )
    offset = bounded(offset, TERMINATOR_SHARE * width)
    flat = smooth.flat.take(geometry.objects.take(weights.hits.triangle))
    curved = np.flatnonzero((length(offset) > 0) & ~flat)

    # Ask the light from there, and of what it reaches, whether the way there is free.
    ng, edge = take_rows(interaction.ng, sample.take(curved)), interaction.edge.take(sample.take(curved))
    starts = offset_ray_origins(_at(position, curved) + _at(offset, curved), ng, edge)
    curved = curved[~tracer.occluded(starts, _at(l, curved), _at(distance, curved))]
    height = length(_at(offset, curved))
    own = column_major(take_rows(origins, sample.take(curved)))
    curved = curved[~tracer.occluded(own, column_major(_at(offset, curved) / height[:, None]), height)]

    # What stands nearby in the light's direction shadows the sample, unless it is the surface itself.
    own, ng = (
        column_major(take_rows(origins, sample.take(curved))),
        take_rows(interaction.ng, sample.take(curved)),
    )
    hit = tracer.closest(own, _above(_at(l, curved), ng))
    near = np.minimum(NEARBY * _at(width, curved), _at(distance, curved))
    same = smooth.parts.are_joined(_at(weights.hits.triangle, curved), np.maximum(hit.triangle, 0))
    reached = np.zeros(len(sample), np.bool_)
    reached[curved[(hit.distance >= near) | same]] = True
    return reached


def _terminator_offset(
    smooth: SmoothSurface, weights: CornerWeights, position: Vectors, back_facing: NDArray[np.bool_]
) -> Vectors:
    """(B, 3) the way from samples on polygons to the surface that the normals at their corners imply."""
    geometry, normals = smooth.context.geometry, smooth.normals

    def way(group: Corners, k: int) -> Vectors:
        normal = take_rows(normals.values, normals.index.take(group.corner(geometry, k)))
        corner = take_rows(geometry.vertices, group.vertex(geometry, k))
        if group.lane is None:
            return to_tangent_plane(position, corner, facing(normal, back_facing))
        return to_tangent_plane(
            take_rows(position, group.lane), corner, facing(normal, back_facing.take(group.lane))
        )

    return weights.joined(way)


def _box_diagonals(geometry: SceneGeometry, weights: CornerWeights) -> Floats:
    """(B,) the diagonal of the bounding box of the polygon under each sample, in radii."""
    out = np.empty(len(weights), F)
    for group in weights.groups:
        corners = [take_rows(geometry.vertices, group.vertex(geometry, k)) for k in range(group.count)]
        size = length(np.maximum.reduce(corners) - np.minimum.reduce(corners))
        out[slice(None) if group.lane is None else group.lane] = size
    return out


def _at(values: NDArray[Any], index: NDArray[np.intp]) -> NDArray[Any]:
    return column_major(take_rows(values, index))


def _above(l: Vectors, ng: Vectors) -> Vectors:
    """(N, 3) float32 `l`, taken along the polygon's plane where it points below it."""
    below = np.minimum(dot(l, ng), 0)
    return column_major(unit(l - below[:, None] * ng), F)
