"""Shading rates: where a model is evaluated, and how its values come back to the samples.

constant   once per polygon seen, with the polygon's own normal
gouraud    once per vertex seen, intensities interpolated (Gouraud 1971)
phong      once per sample, normals interpolated linearly (Phong 1975)
quadratic  once per sample, normals interpolated quadratically (van Overveld and Wyvill 1997)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, column_major, take_rows
from illumcli.geometry.scene_geometry import CornerVectors, PolygonCentres, SceneGeometry
from illumcli.rays.corner_weights import (
    Corners,
    CornerWeights,
    MeanCorners,
    TriangleCorners,
    concatenated,
)
from illumcli.rays.interaction import SurfaceInteraction, facing, interpolated, quadratic
from illumcli.records import Record

RATES = ("constant", "gouraud", "phong", "quadratic")
AT_SAMPLES = frozenset({"phong", "quadratic"})
"""Rates that evaluate the model at every sample."""


class Points(Record):
    """Where models are evaluated, E points on triangles, and how values return to the M samples seen."""

    triangle: Ids  # (E,)
    u: Floats  # (E,)
    v: Floats  # (E,)
    position: Vectors  # (E, 3) float32, in radii
    n: Vectors  # (E, 3) float32 unit shading normal on the side the eye sees
    spread: Callable[[NDArray[Any]], NDArray[Any]]
    """(E, k) values at the points to (M, k) values at the samples."""
    weights: CornerWeights | None = None
    """Of the corners around each point; None where the points are the samples."""

    def __len__(self) -> int:
        return len(self.triangle)


def sample_normals(
    geometry: SceneGeometry,
    weights: CornerWeights,
    interaction: SurfaceInteraction,
    rates: Sequence[str],
    normals: CornerVectors,
) -> Vectors:
    """(M, 3) the interpolated shading normal of every sample, where object i is shaded at ``rates[i]``: of
    `gouraud` the linear one, of `constant` the facet's own."""
    rate = np.array([RATES.index(name) for name in rates], np.int8)
    return _sample_normals(
        geometry, weights, interaction, rate.take(geometry.objects.take(weights.hits.triangle)), normals
    )


def points(
    geometry: SceneGeometry,
    weights: CornerWeights,
    interaction: SurfaceInteraction,
    rates: Sequence[str],
    normals: CornerVectors | None = None,
    centres: PolygonCentres | None = None,
    polygon_normals: NDArray[np.float32] | None = None,
) -> Points:
    """Evaluation points of the samples seen, where object i is shaded at ``rates[i]``.

    Where every object is shaded at the samples, point i is sample i, whatever the mixture of rates.
    """
    if len(set(rates)) == 1 and rates[0] in _POINTS:
        return _POINTS[rates[0]](geometry, weights, interaction, normals, centres, polygon_normals)
    rate = np.array([RATES.index(name) for name in rates], np.int8)
    of_sample = rate.take(geometry.objects.take(weights.hits.triangle))
    if AT_SAMPLES.issuperset(rates):
        return _samples(
            weights, interaction, _sample_normals(geometry, weights, interaction, of_sample, normals)
        )

    # Split the samples: one group per rate with points of its own, and one for all that are shaded in place.
    groups, parts = [], []
    in_place = np.isin(of_sample, [RATES.index(name) for name in AT_SAMPLES])
    for name in (*_POINTS, None):
        group = np.flatnonzero(in_place if name is None else of_sample == RATES.index(name))
        if not group.size:
            continue
        some = weights.take(group)
        own = SurfaceInteraction(*(take_rows(values, group) for values in vars(interaction).values()))
        groups.append(group)
        if name is None:
            n = _sample_normals(geometry, some, own, of_sample.take(group), normals)
            parts.append(_samples(some, own, n))
        else:
            parts.append(_POINTS[name](geometry, some, own, normals, centres, polygon_normals))
    if not parts:
        return _samples(weights, interaction, interaction.ng)

    # Join the groups' points; a value returns to its samples through its own group.
    def spread(values: NDArray[Any]) -> NDArray[Any]:
        out = np.empty((len(weights), *values.shape[1:]), values.dtype, order="F")
        first = 0
        for group, part in zip(groups, parts, strict=True):
            out[group] = part.spread(values[first : first + len(part)])
            first += len(part)
        return out

    joined = {
        name: column_major(np.concatenate([getattr(part, name) for part in parts]))
        for name in ("triangle", "u", "v", "position", "n")
    }
    own_weights = [
        weights.take(group) if part.weights is None else part.weights
        for group, part in zip(groups, parts, strict=True)
    ]
    return Points(**joined, spread=spread, weights=concatenated(own_weights))


def _samples(weights: CornerWeights, interaction: SurfaceInteraction, n: Vectors) -> Points:
    hits = weights.hits
    return Points(hits.triangle, hits.u, hits.v, column_major(interaction.position, F), n, as_they_are)


def as_they_are(values: NDArray[Any]) -> NDArray[Any]:
    """The values at the points, where these are the samples."""
    return values


def _sample_normals(
    geometry: SceneGeometry,
    weights: CornerWeights,
    interaction: SurfaceInteraction,
    of_sample: NDArray[np.int8],
    normals: CornerVectors | None,
) -> Vectors:
    """(M, 3) shading normal of every sample, by the rate of its object; see `sample_normals`."""
    if normals is None:
        return interaction.ng
    bent = of_sample == RATES.index("quadratic")
    flat = of_sample == RATES.index("constant")
    parts = [(np.flatnonzero(bent), quadratic), (np.flatnonzero(~bent & ~flat), interpolated)]
    out = interaction.ng.copy(order="F")
    for group, normal in parts:
        if group.size == len(of_sample):
            return normal(geometry, normals, weights, interaction)
        if group.size:
            own = SurfaceInteraction(*(take_rows(values, group) for values in vars(interaction).values()))
            out[group] = normal(geometry, normals, weights.take(group), own)
    return out


def _constant(
    geometry: SceneGeometry,
    weights: CornerWeights,
    interaction: SurfaceInteraction,
    normals: Any,
    centres: PolygonCentres,
    polygon_normals: Any,
) -> Points:
    """One point per polygon and side seen: its centre, its normal, and the mean of what its corners have."""
    polygon = geometry.polygons.take(weights.hits.triangle)
    key, first, back = np.unique(
        polygon * 2 + interaction.back_facing, return_index=True, return_inverse=True
    )
    own = key // 2
    third = np.full(len(key), 1 / 3, F)
    n = facing(take_rows(polygon_normals, own), interaction.back_facing.take(first))
    triangle = np.searchsorted(geometry.polygons, own).astype(np.int32)
    first_triangle = TriangleCorners(None, triangle, third, third)
    mean = CornerWeights(first_triangle, (MeanCorners(None, centres, own),))
    return Points(
        triangle,
        third,
        third,
        take_rows(centres.position, own),
        n,
        lambda values: take_rows(values, back),
        mean,
    )


def _gouraud(
    geometry: SceneGeometry,
    weights: CornerWeights,
    interaction: SurfaceInteraction,
    normals: Any,
    centres: Any,
    polygon_normals: Any,
) -> Points:
    """One point per polygon corner and side seen: corners of a vertex may differ in normal and uv."""
    found: list[tuple[NDArray[Any], ...]] = []
    numbers: dict[Corners, NDArray[np.int64]] = {}  # (m,) point of each hit's corner 0
    steps: dict[Corners, int] = {}  # how far the next corner's point is away
    count = 0
    for group in weights.groups:
        back_facing = (
            interaction.back_facing if group.lane is None else interaction.back_facing.take(group.lane)
        )
        _, first, back = np.unique(
            group.shape * np.int64(2) + back_facing, return_index=True, return_inverse=True
        )
        numbers[group], steps[group] = back.ravel() + count, len(first)
        for k in range(group.count):
            corner, vertex = (
                take_rows(number(geometry, k), first) for number in (group.corner, group.vertex)
            )
            n = facing(take_rows(normals.values, normals.index.take(corner)), take_rows(back_facing, first))
            at = (take_rows(part, first) for part in group.place(k))
            found.append((*at, take_rows(geometry.vertices, vertex), n))
            count += len(first)

    def spread(values: NDArray[Any]) -> NDArray[Any]:
        return weights.joined(lambda group, k: take_rows(values, numbers[group] + k * steps[group]))

    triangle, u, v, position, n = (
        column_major(np.concatenate([each[part] for each in found])) for part in range(5)
    )
    there = TriangleCorners(None, triangle, u, v)
    return Points(triangle, u, v, position, n, spread, CornerWeights(there, (there,)))


_POINTS: dict[str, Callable[..., Points]] = {"constant": _constant, "gouraud": _gouraud}
