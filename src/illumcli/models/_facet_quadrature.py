"""Quadrature over the normals of facets: panels of the angle theta, and cells of theta and phi.

Both are split until two rules agree: a panel or cell against its parts. The nodes of cells serve for
integrals with a kink along a great circle, too: no cell keeps more than a small share of the whole.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.models._lobes import gauss_legendre
from illumcli.records import Record

Array: TypeAlias = NDArray[np.float64]

ORDER = 16
"""Nodes in a panel."""
CELL_ORDER = 3
"""Nodes along either side of a cell."""
TOLERANCE = 1e-9
"""Relative to the whole integral, of each panel or cell."""
LARGEST_SHARE = 1 / 2048
"""Of the whole integral, in a cell."""
MAX_LEVELS = 40
MAX_CELL_NODES = 1 << 20
"""Evaluated at most for one distribution; cells that still differ from their parts are kept as they are."""


class Facets(Record):
    """Nodes of a quadrature over facets."""

    h: Array  # (3, N) unit normals: along the grain, across it, along the surface's normal
    weight: Array  # (N,) p(h) dh: facet area
    coarse: Facets | None = None
    """The rule before its last refinement, to estimate the error by."""


def first_edges() -> Array:
    """Angles from 0 to pi / 2: equal steps, and near the normal halves of halves."""
    return np.unique(np.concatenate([np.linspace(0, np.pi / 2, 33), np.pi / 2 * 2.0 ** -np.arange(6, 22)]))


def rule(order: int) -> tuple[Array, Array]:
    """Nodes and weights of Gauss and Legendre on 0..1."""
    node, weight = np.array(gauss_legendre(order)).T
    return (1 + node) / 2, weight / 2


def panels(density: Callable[[Array], Array]) -> Array:
    """(P + 1,) edges of the panels in which `density`, of theta, is smooth enough for a rule of `ORDER`."""
    node, weight = rule(ORDER)

    def integrals(low: Array, high: Array) -> Array:
        theta = low[:, None] + (high - low)[:, None] * node
        return density(theta) * np.sin(theta) @ weight * (high - low)

    edges = first_edges()
    done, low, high = [edges[:1]], edges[:-1], edges[1:]
    whole = integrals(low, high)
    total = whole.sum()
    for _ in range(MAX_LEVELS):
        middle = (low + high) / 2
        halves = np.stack([integrals(low, middle), integrals(middle, high)])
        open_panels = np.abs(halves.sum(axis=0) - whole) > TOLERANCE * 1e-4 * total
        done.append(high[~open_panels])
        if not open_panels.any():
            break
        low, high = (np.stack(pair)[:, open_panels].ravel() for pair in ((low, middle), (middle, high)))
        whole = halves[:, open_panels].ravel()
    else:
        done.append(high)
    return np.sort(np.concatenate(done))


def cells(density: Callable[[Array], Array]) -> Facets:
    """Nodes in cells of theta and phi for `density`, of (3, N) normals."""
    node, weight = rule(CELL_ORDER)
    u, v = (grid.ravel() for grid in np.meshgrid(node, node, indexing="ij"))
    w = np.outer(weight, weight).ravel()

    def nodes(cell: Array) -> tuple[Array, Array]:
        """(3, K, n) normals in (4, K) cells and their (K, n) weights."""
        low, high, left, right = cell[:, :, None]
        theta, phi = low + (high - low) * u, left + (right - left) * v
        sine = np.sin(theta)
        h = np.stack([sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)])
        p = density(h.reshape(3, -1)).reshape(theta.shape)
        return h, p * sine * ((high - low) * (right - left)) * w

    # Cells that are about square away from the normal.
    edges = first_edges()
    turns = np.linspace(-np.pi, np.pi, 65)
    low, left = (grid.ravel() for grid in np.meshgrid(edges[:-1], turns[:-1], indexing="ij"))
    high, right = (grid.ravel() for grid in np.meshgrid(edges[1:], turns[1:], indexing="ij"))
    cell = np.stack([low, high, left, right])
    h, area = nodes(cell)
    count = area.size
    total = area.sum()
    fine: list[tuple[Array, Array]] = []
    coarse: list[tuple[Array, Array]] = []
    while cell.shape[1]:
        # Split each cell in four and compare it with its parts.
        parts = split(cell)
        part_h, part_area = nodes(parts)
        count += part_area.size
        of_parts = part_area.reshape(4, *area.shape).sum(axis=(0, 2))
        total += float(of_parts.sum() - area.sum())
        is_open = (np.abs(of_parts - area.sum(axis=1)) > TOLERANCE * total) | (
            of_parts > LARGEST_SHARE * total
        )
        if count + 4 * CELL_ORDER**2 * 4 * np.count_nonzero(is_open) > MAX_CELL_NODES:
            is_open[:] = False
        fine.append(_flat(part_h, part_area, np.tile(~is_open, 4)))
        coarse.append(_flat(h, area, ~is_open))
        again = np.tile(is_open, 4)
        cell, h, area = parts[:, again], part_h[:, again], part_area[again]
    return Facets(*_joined(fine), Facets(*_joined(coarse)))


def split(cell: Array) -> Array:
    """(4, 4 K) the four parts of each of (4, K) cells: all first parts, then all second ones, ..."""
    low, high, left, right = cell
    theta, phi = (low + high) / 2, (left + right) / 2
    return np.concatenate(
        [
            np.stack([low, theta, left, phi]),
            np.stack([low, theta, phi, right]),
            np.stack([theta, high, left, phi]),
            np.stack([theta, high, phi, right]),
        ],
        axis=1,
    )


def _flat(h: Array, area: Array, which: NDArray[np.bool_]) -> tuple[Array, Array]:
    """The nodes of some cells that have any weight."""
    h, area = h[:, which].reshape(3, -1), area[which].ravel()
    counts = area > 0
    return h[:, counts], area[counts]


def _joined(parts: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    return np.concatenate([h for h, _ in parts], axis=1), np.concatenate([area for _, area in parts])


def square_nodes(counts: tuple[int, int], span: tuple[float, float]) -> tuple[Array, Array]:
    """(3, N) normals at the centres of equal cells of leans within -span..span, and the (N,) leans' areas.

    The area is per cos(theta)^3, the solid angle of a cell.
    """
    x, y = (
        (np.arange(count) + 0.5) * (2 * most / count) - most for count, most in zip(counts, span, strict=True)
    )
    x, y = (grid.ravel() for grid in np.meshgrid(x, y, indexing="ij"))
    n = 1 / np.sqrt(1 + x * x + y * y)
    return np.stack([x * n, y * n, n]), 4 * span[0] * span[1] / x.size * n**3


def disc_nodes(count: int) -> tuple[Array, Array]:
    """(3, N) normals in `count` rings of theta, as far apart along them, and their solid angles."""
    step = np.pi / 2 / count
    theta = (np.arange(count) + 0.5) * step
    numbers = np.ceil(2 * np.pi * np.sin(theta) / step).astype(np.int64)
    ring = np.repeat(np.arange(count), numbers)
    first = np.cumsum(numbers) - numbers
    phi = (np.arange(len(ring)) - first[ring] + 0.5) * (2 * np.pi / numbers[ring])
    solid = 2 * np.pi * (np.cos(theta - step / 2) - np.cos(theta + step / 2)) / numbers
    sine = np.sin(theta)[ring]
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), np.cos(theta)[ring]]), solid[ring]
