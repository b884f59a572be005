"""The projected area of a surface of facets, tabulated over directions.

A(k) is the area of all facets that face k, seen from k, per unit of the surface's area:

    A(k) = integral of (h.k)+ D(h) dh = the mean of (kz + x kx + y ky)+ over the surface, at least kz,

where (x, y) is the lean of a facet, h = (x, y, 1) / |(x, y, 1)|, and D its distribution with the integral of
D cos(theta) 1. With k' = L (kx, ky), c = kz / |k'| and the leans L^-1 (x, y), it is |k'| M(c, phi'): a
convex function of c, the second integral of the distribution of leans along phi'. The table holds

    f(phi', u) = A(k) / (kz + |k'|),    u = kz / (kz + |k'|),

which is 1 along the normal (u = 1) and near 2 / pi at grazing (u = 0). L makes the leans equally wide in
all directions, so that the table is as accurate for narrow and stretched distributions as for wide ones; for
those that a stretch makes isotropic, f does not depend on phi'.

References
----------
Ashikhmin, M., Premoze, S., Shirley, P. (2000). A microfacet-based BRDF generator. SIGGRAPH 2000, eq. 6.
Heitz, E. (2014). Understanding the masking-shadowing function in microfacet-based BRDFs. JCGT 3(2).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats
from illumcli.models._facet_quadrature import ORDER, Facets, rule
from illumcli.models._terms import Components
from illumcli.records import Record

Array: TypeAlias = NDArray[np.float64]

STEPS = 256
"""Intervals of u for distributions with a grain."""
ROUND_STEPS = 512
"""Intervals of u for those without, which have a single row."""
TURNS = 128
"""Values of phi' for distributions with a grain."""


class ProjectedArea(Record):
    """A(k), interpolated from a table."""

    stretch: tuple[float, float, float]
    """L: its entries tt, tb and bb."""
    table: Array  # (1, ROUND_STEPS + 1) or (TURNS, STEPS + 1): f at equal steps of phi' and u
    error: float
    """Estimated relative error, of the quadrature and of the interpolation."""

    def of_angle(self, cosine: Floats) -> Floats:
        """(N,) A of a distribution without grain, from the cosine to the normal, in its precision.

        A is smooth in the squared sine: the rounding of the cosine near 1 does not matter.
        """
        across = np.sqrt(np.maximum((1 - cosine) * (1 + cosine), 0)) * cosine.dtype.type(self.stretch[0])
        whole = cosine + across
        row = self.table[0].astype(cosine.dtype)
        return np.maximum(whole * interpolated(row, cosine / whole * (len(row) - 1)), cosine)

    def of_direction(self, k: Components) -> Floats:
        """(N,) A at unit vectors above the surface, in their precision."""
        dtype = k.n.dtype
        tt, tb, bb = np.asarray(self.stretch, dtype)
        x, y = tt * k.t + tb * k.b, tb * k.t + bb * k.b
        across = np.sqrt(x * x + y * y)
        whole = k.n + across
        turns = np.arctan2(y, x) * dtype.type(TURNS / (2 * np.pi))
        f = interpolated_around(self.table.astype(dtype), turns, k.n / whole * STEPS)
        return np.maximum(whole * f, k.n)


def interpolated(row: Floats, steps: Floats) -> Floats:
    """(N,) cubic interpolation in a row of values at 0, 1, 2, ..."""
    first, weights = taps(np.clip(steps, 0, len(row) - 1), len(row))
    return np.sum([row.take(first + k) * weight for k, weight in enumerate(weights)], axis=0)


def interpolated_around(table: Floats, turns: Floats, steps: Floats) -> Floats:
    """(N,) cubic interpolation in both axes; the first is periodic."""
    count, width = table.shape
    first, weights = taps(np.clip(steps, 0, width - 1), width)
    below = np.floor(turns)
    around = lagrange(turns - below)
    flat, row = table.ravel(), below.astype(np.int64) - 1
    total = np.zeros_like(steps)
    for j, share in enumerate(around):
        start = (row + j) % count * width + first
        total += share * np.sum([flat.take(start + k) * weight for k, weight in enumerate(weights)], axis=0)
    return total


def taps(steps: Floats, count: int) -> tuple[NDArray[np.int64], tuple[Floats, ...]]:
    """The first of four neighbours among `count` values at 0, 1, 2, ..., and the weights of all four."""
    below = np.clip(np.floor(steps), 1, count - 3)
    return below.astype(np.int64) - 1, lagrange(steps - below)


def lagrange(x: Floats) -> tuple[Floats, ...]:
    """Weights of the values at -1, 0, 1 and 2 in the cubic through them, at x."""
    a, b, c = x + 1, x - 1, x - 2
    return -x * b * c / 6, a * b * c / 2, -a * x * c / 2, a * x * b / 6


# --- tables ---------------------------------------------------------------------------------------------


def of_angles(density: Callable[[Array], Array], edges: Array) -> tuple[ProjectedArea, float, float]:
    """A of a distribution without grain, and the integrals of p and of p cos(theta) over the hemisphere.

    With r = tan(theta) and c = kz / |k'| the integral over phi has a closed form; its root at r = c is smooth
    in t, t^2 = theta - atan(c).
    """
    facets, seen, lean = _moments(density, edges, ORDER)
    scale = lean / seen / 2  # half the mean of tan(theta) over the surface
    u = np.arange(ROUND_STEPS) / ROUND_STEPS
    fine, coarse = (_row(density, edges, scale, u, order) / seen for order in (ORDER, ORDER * 3 // 4))
    table = np.append(fine, 1.0)[None]
    error = float(np.abs(fine - coarse).max()) + interpolation_error(table)
    return ProjectedArea((scale, 0.0, scale), table, error), facets, seen


def _moments(density: Callable[[Array], Array], edges: Array, order: int) -> tuple[float, float, float]:
    """The integrals of p, p cos(theta) and p sin(theta) over the hemisphere."""
    node, weight = rule(order)
    theta = edges[:-1, None] + np.diff(edges)[:, None] * node
    ring = 2 * np.pi * density(theta) * np.sin(theta) * weight * np.diff(edges)[:, None]
    return float(ring.sum()), float((ring * np.cos(theta)).sum()), float((ring * np.sin(theta)).sum())


def _row(density: Callable[[Array], Array], edges: Array, scale: float, u: Array, order: int) -> Array:
    """(K,) (1 - u) times the integral of p cos(theta) (c + x)+ at u < 1, where c = u / (1 - u)."""
    node, weight = rule(order)
    c = u / (1 - u) * scale
    kink = np.arctan(c)[:, None]
    total = np.zeros(len(u))
    for low, high, above in ((0, kink, False), (kink, np.inf, True)):
        # Panels up to the kink, where all facets of a ring are seen, and beyond it.
        within = np.clip(edges, low, high)
        start, width = within[:, :-1, None], np.diff(within)[..., None]
        theta = start + width * (node**2 if above else node)
        steps = width * weight * (2 * node if above else 1)
        r, at = np.tan(theta), c[:, None, None]
        ring = 2 * np.pi * at
        if above:
            turn = np.minimum(at / r, 1)
            ring = 2 * (at * (np.pi - np.arccos(turn)) + r * np.sqrt((1 - turn) * (1 + turn)))
        total += (density(theta) * np.cos(theta) * np.sin(theta) * ring * steps).sum(axis=(1, 2))
    return (1 - u) / scale * total


def of_facets(facets: Facets) -> tuple[ProjectedArea, float, float]:
    """A of facets in any directions, and the integrals of p and of p cos(theta) over the hemisphere."""
    tt, tb, bb = stretch(facets)
    table = _table(facets, (tt, tb, bb))
    error = interpolation_error(table)
    if facets.coarse is not None:
        error += float(np.abs(_table(facets.coarse, (tt, tb, bb)) - table).max())
    seen = float((facets.weight * facets.h[2]).sum())
    return ProjectedArea((tt, tb, bb), table, error), float(facets.weight.sum()), seen


def stretch(facets: Facets) -> tuple[float, float, float]:
    """L, symmetric, with L L = the mean of s s' / |L^-1 s| over the surface, s = (x, y); by iteration."""
    t, b, n = facets.h
    weight = facets.weight / (facets.weight * n).sum()
    matrix = np.eye(2)
    for _ in range(30):
        values, vectors = np.linalg.eigh(matrix)
        root = np.sqrt(np.maximum(values, 1e-8 * values.max()))
        inverse = vectors / root @ vectors.T
        length = np.hypot(inverse[0, 0] * t + inverse[0, 1] * b, inverse[1, 0] * t + inverse[1, 1] * b)
        share = weight / np.maximum(length, 1e-300)
        tb = float((share * t * b).sum())
        matrix = np.array([[float((share * t * t).sum()), tb], [tb, float((share * b * b).sum())]])
    values, vectors = np.linalg.eigh(matrix)
    root = np.sqrt(np.maximum(values, 1e-8 * values.max()))
    L = vectors * root @ vectors.T
    return float(L[0, 0]), float(L[0, 1]), float(L[1, 1])


def _table(facets: Facets, stretched: tuple[float, float, float]) -> Array:
    """(TURNS, STEPS + 1) f."""
    tt, tb, bb = stretched
    inverse = np.array([[bb, -tb], [-tb, tt]]) / (tt * bb - tb * tb)
    t, b, n = facets.h
    seen = facets.weight * n / (facets.weight * n).sum()
    x, y = (inverse[0, 0] * t + inverse[0, 1] * b) / n, (inverse[1, 0] * t + inverse[1, 1] * b) / n
    u = np.arange(STEPS) / STEPS
    table = np.ones((TURNS, STEPS + 1))
    half = TURNS // 2
    for turn, phi in enumerate(np.arange(half) * (np.pi / half)):
        # A facet that leans away is seen from the u of its lean on; seen from opposite, all others are those.
        lean = np.cos(phi) * x + np.sin(phi) * y
        steep = np.abs(lean)
        bins = np.ceil(steep / (1 + steep) * STEPS).astype(np.int64) + (lean > 0) * (STEPS + 1)
        count, leans = (
            np.bincount(bins, share, 2 * STEPS + 2).reshape(2, -1) for share in (seen, seen * lean)
        )
        for row, sign, away in ((turn, 1, 0), (turn + half, -1, 1)):
            in_sight = count[away].cumsum()[:STEPS] + count[1 - away].sum()
            slopes = sign * (leans[away].cumsum()[:STEPS] + leans[1 - away].sum())
            table[row, :STEPS] = u * in_sight + (1 - u) * slopes
    return table


def interpolation_error(table: Array) -> float:
    """The largest error at the odd nodes if the even ones alone are interpolated; an upper bound for all."""
    steps = np.arange(1.0, table.shape[1] - 1, 2)
    error = max(float(np.abs(interpolated(row[::2], steps / 2) - row[1::2]).max()) for row in table)
    if len(table) > 1:
        turn, step = (grid.ravel() for grid in np.meshgrid(np.arange(1.0, TURNS, 2), np.arange(STEPS + 1.0)))
        between = interpolated_around(table[::2], turn / 2, step)
        exact = table[turn.astype(np.int64), step.astype(np.int64)]
        error = max(error, float(np.abs(between - exact).max()))
    return error
