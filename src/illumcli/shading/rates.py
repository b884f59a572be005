"""Shading rates: where models are evaluated, and how the samples get their values from there.

`RATES`, at the end, has a row for each.

References
----------
Gouraud, H. (1971). Continuous shading of curved surfaces. IEEE Transactions on Computers C-20(6).
Phong, B. T. (1975). Illumination for computer generated pictures. Communications of the ACM 18(6).
van Overveld, C. W. A. M., Wyvill, B. (1997). Phong normal interpolation revisited. ACM ToG 16(4).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, column_major, take_rows, unit
from illumcli.geometry.scene_geometry import PolygonCentres
from illumcli.rays.corner_weights import (
    Corners,
    CornerWeights,
    MeanCorners,
    TriangleCorners,
    concatenated,
)
from illumcli.rays.interaction import ShadingContext, facing, interpolated, quadratic
from illumcli.records import Record, Value

Rate: TypeAlias = str
"""Name of a shading rate, a key of `RATES`."""


class Identity(Record):
    """Point i is sample i."""

    def __call__(self, values: NDArray[Any]) -> NDArray[Any]:
        return values


class Gather(Record):
    """Each sample takes the value of one point."""

    point: NDArray[np.intp]  # (M,)

    def __call__(self, values: NDArray[Any]) -> NDArray[Any]:
        return take_rows(values, self.point)


class Barycentric(Record):
    """Each sample takes the weighted mean of the points at its polygon's corners."""

    weights: CornerWeights
    first: Mapping[Corners, NDArray[np.int64]]  # group -> (m,) index of the point at each hit's corner 0
    step: Mapping[Corners, int]  # group -> difference of the indices of consecutive corners

    def __call__(self, values: NDArray[Any]) -> NDArray[Any]:
        return self.weights.weighted_mean(
            lambda group, k: take_rows(values, self.first[group] + k * self.step[group])
        )


class Mixed(Record):
    """Groups of samples, each with its own rule; the points of the groups are consecutive."""

    groups: tuple[NDArray[np.intp], ...]  # sample indices of each group
    sizes: tuple[int, ...]  # number of points of each group
    parts: tuple[ToSamples, ...]

    def __call__(self, values: NDArray[Any]) -> NDArray[Any]:
        count = sum(len(group) for group in self.groups)
        out = np.empty((count, *values.shape[1:]), values.dtype, order="F")
        first = 0
        for group, size, part in zip(self.groups, self.sizes, self.parts, strict=True):
            out[group] = part(values[first : first + size])
            first += size
        return out


ToSamples: TypeAlias = Identity | Gather | Barycentric | Mixed
"""A function from (E, k) values at shading points to (M, k) values at samples."""


class ShadingPoints(Record):
    """Where models are evaluated: E points on triangles, and how the M samples get their values."""

    objects: Ids  # (E,) object of each
    triangle: Ids  # (E,) stored triangle
    u: Floats  # (E,)
    v: Floats  # (E,)
    position: Vectors  # (E, 3) float32, in radii
    n: Vectors  # (E, 3) float32 unit shading normal, on the eye's side
    to_samples: ToSamples
    weights: CornerWeights | None = None
    """Weights of the corners around each point; None if the points are the samples."""

    def __len__(self) -> int:
        return len(self.triangle)

    @property
    def are_samples(self) -> bool:
        """True if point i is sample i."""
        return isinstance(self.to_samples, Identity)


def points(
    rates: Sequence[Rate],
    shading_context: ShadingContext,
    centres: PolygonCentres | None = None,
    polygon_normals: NDArray[np.float32] | None = None,
) -> ShadingPoints:
    """The shading points of M samples, where object i is shaded at ``rates[i]``.

    If all rates evaluate at the samples, point i is sample i, even if the rates differ.

    Parameters
    ----------
    centres, polygon_normals : PolygonCentres, (P, 3) float32, optional
        Needed if some object is shaded once per polygon.
    """
    # One rate for all objects, or several that all evaluate at the samples: no groups.
    context = shading_context
    if len(set(rates)) == 1 and (own_points := RATES[rates[0]].points) is not None:
        return own_points(context, centres, polygon_normals)
    if all(RATES[name].at_samples for name in set(rates)):
        return _samples(context, obscurance_normals(rates, context))

    # Split the samples: one group per rate that has its own points, and one for all that are shaded in place.
    of_sample = _rate_of_samples(rates, context)
    groups, parts = [], []
    for number, rate in enumerate(RATES.values()):
        group = np.flatnonzero(of_sample == number)
        if rate.points is not None and group.size:
            groups.append(group)
            parts.append(rate.points(context.take(group), centres, polygon_normals))
    in_place = np.array([rate.at_samples for rate in RATES.values()]).take(of_sample)
    if (group := np.flatnonzero(in_place)).size:
        n = _sample_normals(context.take(group), of_sample.take(group))
        groups.append(group)
        parts.append(_samples(context.take(group), n))
    if not parts:
        return _samples(context, context.interaction.ng)

    # Concatenate the groups' points; each group's samples take values from its own points.
    to_samples = Mixed(tuple(groups), tuple(map(len, parts)), tuple(part.to_samples for part in parts))
    joined = {
        name: column_major(np.concatenate([getattr(part, name) for part in parts]))
        for name in ("objects", "triangle", "u", "v", "position", "n")
    }
    weights = [
        context.weights.take(group) if part.weights is None else part.weights
        for group, part in zip(groups, parts, strict=True)
    ]
    return ShadingPoints(**joined, to_samples=to_samples, weights=concatenated(weights))


def point_weights(points: ShadingPoints, corner_weights: CornerWeights) -> CornerWeights:
    """The weights of the corners around each shading point."""
    return corner_weights if points.weights is None else points.weights


def normal(points: ShadingPoints) -> Vectors:
    """(M, 3) unit shading normal of every sample, on the eye's side."""
    return unit(points.to_samples(points.n))


def obscurance_normals(rates: Sequence[Rate], shading_context: ShadingContext) -> Vectors:
    """(M, 3) interpolated shading normal of every sample, the axis of its hemisphere of obscurance rays.

    Object i is shaded at ``rates[i]``; `gouraud` has the linear normal here, `constant` the triangle's.
    """
    functions = {RATES[name].normals for name in set(rates)}
    if len(functions) == 1:
        return functions.pop()(shading_context)
    return _sample_normals(shading_context, _rate_of_samples(rates, shading_context))


def normals_of_points(points: ShadingPoints) -> Vectors:
    """(M, 3) the same where every object is shaded at the samples: the normals that it is shaded with."""
    return points.n


def _rate_of_samples(rates: Sequence[Rate], context: ShadingContext) -> NDArray[np.int8]:
    """(M,) row in `RATES` of the rate of each sample's object."""
    row = {name: number for number, name in enumerate(RATES)}
    number = np.fromiter(map(row.__getitem__, rates), np.int8, len(rates))
    return number.take(context.weights.hits.objects)


def _sample_normals(context: ShadingContext, of_sample: NDArray[np.int8]) -> Vectors:
    """(M, 3) shading normal of every sample, by the rate of its object."""
    by_function: dict[Normals, list[int]] = {}
    for number, rate in enumerate(RATES.values()):
        by_function.setdefault(rate.normals, []).append(number)
    out = context.interaction.ng.copy(order="F")
    for normals, numbers in by_function.items():
        group = np.flatnonzero(np.isin(of_sample, numbers))
        if group.size == len(of_sample):
            return normals(context)
        if group.size:
            out[group] = normals(context.take(group))
    return out


def _samples(context: ShadingContext, n: Vectors) -> ShadingPoints:
    """The samples as shading points, with normals `n`."""
    hits = context.weights.hits
    position = column_major(context.interaction.position, F)
    return ShadingPoints(hits.objects, hits.triangle, hits.u, hits.v, position, n, Identity())


def _constant(
    context: ShadingContext, centres: PolygonCentres | None, polygon_normals: NDArray[np.float32] | None
) -> ShadingPoints:
    """One point per visible polygon and side: its centre, its normal, and the mean of its corners' values."""
    assert centres is not None
    assert polygon_normals is not None
    geometry, back_facing, hits = context.geometry, context.interaction.back_facing, context.weights.hits
    visible = geometry.polygons.take(hits.triangle)
    _, first, point = np.unique(
        _keys(hits.objects, visible, back_facing), return_index=True, return_inverse=True
    )
    objects, polygon = hits.objects.take(first), visible.take(first)
    n = geometry.unit_normals(objects, take_rows(polygon_normals, polygon))
    n = facing(n, back_facing.take(first))

    # A point belongs to its polygon's first triangle, but interpolates over all corners of the polygon.
    third = np.full(len(first), 1 / 3, F)
    triangle = np.searchsorted(geometry.polygons, polygon).astype(np.int32)
    first_triangle = TriangleCorners(None, objects, triangle, third, third)
    mean = CornerWeights(first_triangle, (MeanCorners(None, objects, centres, polygon),))
    position = geometry.positions(objects, take_rows(centres.position, polygon))
    return ShadingPoints(objects, triangle, third, third, position, n, Gather(point), mean)


def _gouraud(
    context: ShadingContext, centres: PolygonCentres | None, polygon_normals: NDArray[np.float32] | None
) -> ShadingPoints:
    """One point per corner of a visible polygon and side; a vertex's corners may differ in normal and uv."""
    geometry, weights, normals = context.geometry, context.weights, context.normals
    assert normals is not None
    corners: list[tuple[NDArray[Any], ...]] = []  # objects, triangle, u, v, position, n
    first_point: dict[Corners, NDArray[np.int64]] = {}
    step: dict[Corners, int] = {}
    count = 0
    for group in weights.groups:
        # The group's visible polygons, each side once.
        back_facing = context.interaction.back_facing
        back_facing = back_facing if group.index is None else back_facing.take(group.index)
        side = _keys(group.objects, group.shape, back_facing)
        _, first, number = np.unique(side, return_index=True, return_inverse=True)
        first_point[group], step[group] = number.ravel() + count, len(first)
        objects = group.objects.take(first)

        # A point at each of their corners: corner 0 of all polygons, then corner 1, and so on.
        for k in range(group.count):
            corner, vertex = (
                take_rows(number(geometry, k), first) for number in (group.corner, group.vertex)
            )
            n = geometry.unit_normals(objects, take_rows(normals.values, normals.index.take(corner)))
            n = facing(n, take_rows(back_facing, first))
            at = (take_rows(part, first) for part in group.corner_on_triangle(k))
            position = geometry.positions(objects, take_rows(geometry.vertices, vertex))
            corners.append((objects, *at, position, n))
            count += len(first)
    objects, triangle, u, v, position, n = (
        column_major(np.concatenate([each[part] for each in corners])) for part in range(6)
    )
    at_corners = TriangleCorners(None, objects, triangle, u, v)
    own_weights = CornerWeights(at_corners, (at_corners,))
    return ShadingPoints(
        objects, triangle, u, v, position, n, Barycentric(weights, first_point, step), own_weights
    )


def _keys(objects: Ids, element: NDArray[Any], back_facing: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(N,) a number for each side of a polygon or triangle of an object, equal for equal ones."""
    of_object = np.int64(int(element.max(initial=0)) + 1)
    return np.asarray((objects * of_object + element) * 2 + back_facing)


def _flat(context: ShadingContext) -> Vectors:
    """(M, 3) the triangles' geometric normals."""
    return context.interaction.ng


Normals: TypeAlias = Callable[[ShadingContext], Vectors]
OwnPoints: TypeAlias = Callable[
    [ShadingContext, PolygonCentres | None, NDArray[np.float32] | None], ShadingPoints
]


class ShadingRate(Value):
    """How often a model is evaluated, and with which normals."""

    text: str
    """What it does, for the schema."""
    normals: Normals
    """(M, 3) normals at the samples; also the axes of the hemispheres of obscurance rays."""
    points: OwnPoints | None = None
    """Its own shading points; None if models are evaluated at every sample."""
    is_smooth: bool = True
    """True if it reads the shading normals at corners."""
    of_polygons: bool = False
    """True if its points are polygons' centres, with the polygons' normals."""
    normals_alone: bool = False
    """True if only normals are interpolated over polygons, and linearly."""

    @property
    def at_samples(self) -> bool:
        """True if models are evaluated at every sample."""
        return self.points is None


RATES: Mapping[Rate, ShadingRate] = {
    "constant": ShadingRate("once per polygon.", _flat, _constant, is_smooth=False, of_polygons=True),
    "gouraud": ShadingRate("once per vertex, intensities interpolated.", interpolated, _gouraud),
    "phong": ShadingRate("once per sample, normals interpolated linearly.", interpolated, normals_alone=True),
    "quadratic": ShadingRate("once per sample, normals interpolated quadratically.", quadratic),
}
"""Every shading rate once, by the name in scenes."""
