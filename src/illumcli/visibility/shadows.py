"""Shadows: delta(p, j), by a shadow ray from each sample that light j may reach.

A shadow ray starts on the polygon. Where polygons approximate a smooth surface this causes the shadow
terminator problem: polygons on the lit side of the surface that face away from the light, or are hidden by
their neighbours, would be in shadow. So if the ray of a sample is blocked, a second ray starts from the
smooth surface that the normals imply. It must not skip an occluder: the segment to its origin must be
unoccluded, and nothing but the surface itself may be nearby in the light's direction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Vectors, column_major, dot, length, take_or_all, take_rows, unit
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
SEARCHES = 4
"""So many lights compute the implied surface at samples of their own; the next one at all of the tile."""


class SmoothSurface:
    """The smooth surface that normals imply at the samples of a tile, where shadow rays may start.

    It depends on no light. It is computed at the samples that a light asks for and kept for the lights that
    follow; a tile has one thread.
    """

    def __init__(
        self,
        context: ShadingContext,
        normals: CornerVectors,
        parts: SmoothParts,
        flat: NDArray[np.bool_],
    ) -> None:
        """`flat` is True for objects whose shadow rays start on their polygons, (O,)."""
        count = len(context.weights)
        self.interaction, self.parts = context.interaction, parts
        self.geometry, self.hits = context.geometry, context.weights.hits
        self._context, self._normals, self._flat = context, normals, flat
        self._searches = 0
        self._is_known, self._is_curved = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
        self.offset = np.empty((count, 3), F, order="F")
        """(M, 3) from the samples of `curved` to the implied surface."""
        self.start = np.empty((count, 3), F, order="F")
        """(M, 3) origins of rays from there."""
        self.width = np.empty(count, F)
        """(M,) diagonal of the bounding box of each of their polygons [radii]."""

    def curved(self, sample: NDArray[np.intp]) -> NDArray[np.intp]:
        """Indices into `sample` of the samples that lie below the implied surface."""
        if self._searches <= SEARCHES:
            asked = np.full(len(self._is_known), self._searches == SEARCHES)
            asked[sample] = True
            unknown = np.flatnonzero(asked & ~self._is_known)
            if unknown.size:
                self._searches += 1
                self._compute(unknown)
        return np.flatnonzero(self._is_curved.take(sample))

    def _compute(self, sample: NDArray[Any]) -> None:
        """The offset from each sample to the implied surface; it is 0 on flat polygons and objects."""
        interaction, geometry = self.interaction, self.geometry
        weights = self._context.weights.take(sample)
        position = take_rows(interaction.position, sample)
        width = _box_diagonals(geometry, weights)
        offset = self._terminator_offset(
            weights, column_major(position, F), interaction.back_facing.take(sample)
        )
        offset = bounded(offset, TERMINATOR_SHARE * width)
        is_flat = self._flat.take(weights.hits.objects)
        curved = np.flatnonzero((length(offset) > 0) & ~is_flat)

        # Keep it where it is not 0, with the origins of rays from there.
        self._is_known[sample] = True
        sample, offset = sample.take(curved), _at(offset, curved)
        ng, edge = take_rows(interaction.ng, sample), interaction.edge.take(sample)
        self._is_curved[sample] = True
        self.offset[sample] = offset
        self.start[sample] = offset_ray_origins(_at(position, curved) + offset, ng, edge)
        self.width[sample] = width.take(curved)

    def _terminator_offset(
        self, weights: CornerWeights, position: Vectors, back_facing: NDArray[np.bool_]
    ) -> Vectors:
        """(B, 3) offset of samples on polygons to the surface that the normals at the corners imply."""
        geometry, normals = self.geometry, self._normals

        def corner_offset(group: Corners, k: int) -> Vectors:
            normal, corner = group.normal(geometry, normals, k), group.position(geometry, k)
            if group.index is None:
                return to_tangent_plane(position, corner, facing(normal, back_facing))
            return to_tangent_plane(
                take_rows(position, group.index), corner, facing(normal, back_facing.take(group.index))
            )

        return weights.weighted_mean(corner_offset)


def smooth_surface(
    flat: Sequence[bool], shading_context: ShadingContext, smooth_parts: SmoothParts
) -> SmoothSurface:
    """The smooth surface that the normals of the samples imply; `flat` objects have none."""
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
    hidden, delta = _by_first_rays(tracer, ray_origins, shadow_candidates)
    if smooth_surface is not None:
        blocked = Blocked.of([(shadow_candidates, hidden)])
        delta[blocked.sample.take(_lit_on_implied_surface(tracer, smooth_surface, ray_origins, blocked))] = 1
    return delta


class Shadows(Record):
    """Shadows of several lights."""

    delta: Mapping[str, NDArray[np.float32]]  # candidates of a light -> (M,) its delta
    rays: Mapping[str, int]  # candidates of a light -> rays that were cast for it

    def shares(self, seconds: float) -> dict[str, float]:
        """The time that they took, light by light."""
        total = max(sum(self.rays.values()), 1)
        return {name: seconds * rays / total for name, rays in self.rays.items()}


def shadows(
    tracer: Tracer, ray_origins: Vectors, smooth_surface: SmoothSurface, **candidates: LitPoints
) -> Shadows:
    """The shadows of lights with these candidates, each as by `shadow`, in less time."""
    # The first ray of each light's samples.
    firsts = [_by_first_rays(tracer, ray_origins, lit) for lit in candidates.values()]
    rays = {name: len(lit.index) for name, lit in candidates.items()}

    # The others of all lights together; they are counted with those of the last one.
    before = tracer.rays
    hidden = [each for each, _ in firsts]
    blocked = Blocked.of([*zip(candidates.values(), hidden, strict=True)])
    lit_there = _lit_on_implied_surface(tracer, smooth_surface, ray_origins, blocked)
    rays[next(reversed(rays))] += tracer.rays - before

    # Back to the lights.
    ends = np.cumsum([np.count_nonzero(each) for each in hidden])
    of_lights = np.split(blocked.sample.take(lit_there), np.searchsorted(lit_there, ends[:-1]))
    for (_, delta), sample in zip(firsts, of_lights, strict=True):
        delta[sample] = 1
    return Shadows(dict(zip(candidates, (delta for _, delta in firsts), strict=True)), rays)


def shadow_of(light: str, shadows: Shadows) -> NDArray[np.float32]:
    """(M,) delta of the light with these candidates."""
    return shadows.delta[light]


def _by_first_rays(
    tracer: Tracer, ray_origins: Vectors, lit: LitPoints
) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
    """(K,) which lit points are occluded from the polygon, and (M,) delta by that alone."""
    origins = column_major(take_or_all(ray_origins, lit.index))
    hidden = tracer.occluded(origins, lit.l, lit.distance, coherent=True)
    delta = np.zeros(lit.count, F)
    delta[lit.index] = ~hidden
    return hidden, delta


class Blocked(Record):
    """Samples whose ray to a light is blocked, of one light after the other."""

    sample: NDArray[np.intp]  # (B,)
    l: Vectors  # (B, 3) unit, to the light
    distance: Floats  # (B,) to the light, in radii

    @classmethod
    def of(cls, lights: Sequence[tuple[LitPoints, NDArray[np.bool_]]]) -> Blocked:
        """Those of lights with these lit points, of which some are occluded, (K,)."""
        which = [np.flatnonzero(hidden) for _, hidden in lights]
        pairs = [(lit, blocked) for (lit, _), blocked in zip(lights, which, strict=True)]
        return cls(
            np.concatenate([take_rows(lit.index, blocked) for lit, blocked in pairs]),
            np.concatenate([take_rows(lit.l, blocked).T for lit, blocked in pairs], axis=1).T,
            np.concatenate([take_rows(lit.distance, blocked) for lit, blocked in pairs]),
        )


def _lit_on_implied_surface(
    tracer: Tracer, smooth: SmoothSurface, origins: Vectors, blocked: Blocked
) -> NDArray[np.intp]:
    """Indices of those of the `blocked` samples that the light reaches on the implied surface, ascending."""
    # Keep the points whose shadow ray from there is unoccluded, as is the segment to the ray's origin.
    curved = smooth.curved(blocked.sample)
    if not curved.size:
        return curved
    sample, distance = blocked.sample.take(curved), blocked.distance.take(curved)
    l = _at(blocked.l, curved)
    reached = np.flatnonzero(~tracer.occluded(take_rows(smooth.start, sample), l, distance, coherent=True))
    if not reached.size:
        return reached
    offset = take_rows(smooth.offset, sample.take(reached))
    height = length(offset)
    starts = take_rows(origins, sample.take(reached))
    is_free = ~tracer.occluded(starts, column_major(offset / height[:, None]), height)

    # Anything nearby in the light's direction shadows the point, except the surface itself.
    starts, reached = column_major(starts[is_free]), reached[is_free]
    sample, distance = sample.take(reached), distance.take(reached)
    hit = tracer.closest(starts, _above(take_rows(l, reached), take_rows(smooth.interaction.ng, sample)))
    near = np.minimum(NEARBY * smooth.width.take(sample), distance)
    is_surface = (hit.triangle >= 0) & (
        smooth.geometry.objects_of(hit.triangle, hit.instance) == smooth.hits.objects.take(sample)
    )
    same = np.flatnonzero(is_surface)
    own = smooth.hits.triangle.take(sample.take(same))
    is_surface[same] = smooth.parts.are_joined(own, hit.triangle.take(same))
    return curved[reached[(hit.distance >= near) | is_surface]]


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
