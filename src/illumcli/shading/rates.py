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

from illumcli.arrays import F, Ids, Lanes, Vectors, columns, rows
from illumcli.geometry.assemble import CornerVectors, World
from illumcli.rays.surface import Facets, Hits, facing, interpolated, quadratic
from illumcli.records import Record

RATES = ("constant", "gouraud", "phong", "quadratic")
AT_SAMPLES = frozenset({"phong", "quadratic"})
"""Rates that evaluate the model at every sample."""


class Points(Record):
    """Where models are evaluated, E points on triangles, and how values return to the M samples seen."""

    triangle: Ids  # (E,)
    u: Lanes  # (E,)
    v: Lanes  # (E,)
    position: Vectors  # (E, 3) float32, in radii
    n: Vectors  # (E, 3) float32 unit shading normal on the side the eye sees
    spread: Callable[[NDArray[Any]], NDArray[Any]]
    """(E, k) values at the points to (M, k) values at the samples."""

    def __len__(self) -> int:
        return len(self.triangle)


def sample_normals(
    world: World, hits: Hits, facet: Facets, rates: Sequence[str], normals: CornerVectors
) -> Vectors:
    """(M, 3) the interpolated shading normal of every sample, where object i is shaded at ``rates[i]``: of
    `gouraud` the linear one, of `constant` the facet's own."""
    rate = np.array([RATES.index(name) for name in rates], np.int8)
    return _sample_normals(world, hits, facet, rate.take(world.objects.take(hits.triangle)), normals)


def points(
    world: World,
    hits: Hits,
    facet: Facets,
    rates: Sequence[str],
    normals: CornerVectors | None = None,
    centres: NDArray[np.float32] | None = None,
    polygon_normals: NDArray[np.float32] | None = None,
) -> Points:
    """Evaluation points of the samples seen, where object i is shaded at ``rates[i]``.

    Where every object is shaded at the samples, point i is sample i, whatever the mixture of rates.
    """
    if len(set(rates)) == 1 and rates[0] in _POINTS:
        return _POINTS[rates[0]](world, hits, facet, normals, centres, polygon_normals)
    rate = np.array([RATES.index(name) for name in rates], np.int8)
    of_sample = rate.take(world.objects.take(hits.triangle))
    if AT_SAMPLES.issuperset(rates):
        return _samples(hits, facet, _sample_normals(world, hits, facet, of_sample, normals))

    # Split the samples: one group per rate with points of its own, and one for all that are shaded in place.
    groups, parts = [], []
    in_place = np.isin(of_sample, [RATES.index(name) for name in AT_SAMPLES])
    for name in (*_POINTS, None):
        group = np.flatnonzero(in_place if name is None else of_sample == RATES.index(name))
        if not group.size:
            continue
        some = Hits(*(values.take(group) for values in vars(hits).values()))
        own = Facets(*(rows(values, group) for values in vars(facet).values()))
        groups.append(group)
        if name is None:
            n = _sample_normals(world, some, own, of_sample.take(group), normals)
            parts.append(_samples(some, own, n))
        else:
            parts.append(_POINTS[name](world, some, own, normals, centres, polygon_normals))
    if not parts:
        return _samples(hits, facet, facet.ng)

    # Join the groups' points; a value returns to its samples through its own group.
    def spread(values: NDArray[Any]) -> NDArray[Any]:
        out = np.empty((len(hits.triangle), *values.shape[1:]), values.dtype, order="F")
        first = 0
        for group, part in zip(groups, parts, strict=True):
            out[group] = part.spread(values[first : first + len(part)])
            first += len(part)
        return out

    joined = {
        name: columns(np.concatenate([getattr(part, name) for part in parts]))
        for name in ("triangle", "u", "v", "position", "n")
    }
    return Points(**joined, spread=spread)


def _samples(hits: Hits, facet: Facets, n: Vectors) -> Points:
    return Points(hits.triangle, hits.u, hits.v, columns(facet.position, F), n, as_they_are)


def as_they_are(values: NDArray[Any]) -> NDArray[Any]:
    """The values at the points, where these are the samples."""
    return values


def _sample_normals(
    world: World, hits: Hits, facet: Facets, of_sample: NDArray[np.int8], normals: CornerVectors | None
) -> Vectors:
    """(M, 3) shading normal of every sample, by the rate of its object; see `sample_normals`."""
    if normals is None:
        return facet.ng
    bent = of_sample == RATES.index("quadratic")
    flat = of_sample == RATES.index("constant")
    parts = [(np.flatnonzero(bent), quadratic), (np.flatnonzero(~bent & ~flat), interpolated)]
    out = facet.ng.copy(order="F")
    for group, normal in parts:
        if group.size == len(of_sample):
            return normal(world, normals, hits.triangle, hits.u, hits.v, facet)
        if group.size:
            own = Facets(*(rows(values, group) for values in vars(facet).values()))
            triangle, u, v = hits.triangle.take(group), hits.u.take(group), hits.v.take(group)
            out[group] = normal(world, normals, triangle, u, v, own)
    return out


def _constant(
    world: World, hits: Hits, facet: Facets, normals: Any, centres: Any, polygon_normals: Any
) -> Points:
    """One point per polygon and side seen: its centre, its normal; its uv are those of the middle of its
    first triangle, whichever of its triangles the tile sees."""
    polygon = world.polygons.take(hits.triangle)
    key, first, back = np.unique(polygon * 2 + facet.behind, return_index=True, return_inverse=True)
    own = key // 2
    third = np.full(len(key), 1 / 3, F)
    n = facing(rows(polygon_normals, own), facet.behind.take(first))
    triangle = np.searchsorted(world.polygons, own).astype(np.int32)
    return Points(triangle, third, third, rows(centres, own), n, lambda values: rows(values, back))


def _gouraud(
    world: World, hits: Hits, facet: Facets, normals: Any, centres: Any, polygon_normals: Any
) -> Points:
    """One point per vertex and side seen, where vertices with several normals count as several."""
    corner = np.concatenate([world.corners[:, k].take(hits.triangle) for k in range(3)])
    behind = np.tile(facet.behind, 3)
    # corners that share vertex, normal and side share their value; uv may differ between them
    _, first, back = np.unique(corner.astype(np.int64) * 2 + behind, return_index=True, return_inverse=True)
    which, sample = np.divmod(first, len(hits.triangle))
    triangle = hits.triangle.take(sample)
    vertex = world.triangles[triangle, which]
    n = facing(rows(normals.values, normals.index.take(corner.take(first))), behind.take(first))
    a, b, c = back.reshape(3, -1)
    w0, w1, w2 = 1 - hits.u - hits.v, hits.u, hits.v

    def spread(values: NDArray[Any]) -> NDArray[Any]:
        return w0[:, None] * rows(values, a) + w1[:, None] * rows(values, b) + w2[:, None] * rows(values, c)

    return Points(
        triangle, (which == 1).astype(F), (which == 2).astype(F), rows(world.vertices, vertex), n, spread
    )


_POINTS: dict[str, Callable[..., Points]] = {"constant": _constant, "gouraud": _gouraud}
