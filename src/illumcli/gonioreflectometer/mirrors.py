"""Mirror facets: once by the facets whose normal is the half vector, several times by rays from the light."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats, column_major, dot, mirror, take_rows
from illumcli.gonioreflectometer.bench import Bench
from illumcli.gonioreflectometer.directions import (
    LEAST_COSINE,
    AngleGrid,
    around_half_vector,
)
from illumcli.gonioreflectometer.estimate import REPLICATES
from illumcli.gonioreflectometer.surface import Surface
from illumcli.rays.sampling import kronecker
from illumcli.records import Record

CHUNK = 1 << 17
"""Facets, or rays, that are looked at together."""
NODES = 32
"""Half vectors of a ring for which it is asked whether light and eye stand above the horizon."""

Fresnel: TypeAlias = Callable[[Floats], Floats]
"""(3, N) the reflectance at (N,) cosines."""


class Ring(Record):
    """The facets of a surface whose normals lie between two polar angles."""

    low: float
    high: float
    """Polar angles [rad]."""
    triangles: NDArray[np.int32]
    """Those of the surface."""
    share: Floats
    """Cumulative area of the triangles, over that of all."""
    density: float
    """D: their area over that of the footprint and the solid angle of the ring [1/sr]."""

    @classmethod
    def of(cls, surface: Surface, theta: float, half_width: float) -> Ring:
        """The ring about a polar angle [rad]."""
        low, high = max(theta - half_width, 0.0), min(theta + half_width, np.pi / 2)
        up = surface.normals[:, 2]
        chosen = np.flatnonzero((up <= np.cos(low)) & (up > np.cos(high)) & (surface.areas > 0))
        total = np.cumsum(surface.areas[chosen])
        area = float(total[-1]) if len(total) else 0.0
        solid_angle = 2 * np.pi * (np.cos(low) - np.cos(high))
        return cls(
            low,
            high,
            chosen.astype(np.int32),
            total / max(area, 1e-300),
            area / surface.footprint / solid_angle,
        )


def above_horizon(ring: Ring, theta_d: Floats, phi_d: Floats) -> Floats:
    """(C,) the part of a ring's solid angle in which light and eye are high enough to be measured."""
    cosines = np.cos(ring.high) + (np.arange(NODES) + 0.5) / NODES * (np.cos(ring.low) - np.cos(ring.high))
    counts = np.zeros(len(theta_d))
    along, away = np.cos(theta_d), np.abs(np.sin(theta_d) * np.cos(phi_d))
    for cosine in cosines:  # the lower of n.l and n.v
        counts += along * cosine - away * np.sqrt(1 - cosine * cosine) > LEAST_COSINE
    return counts / NODES


def mirrored_once(
    bench: Bench,
    facets: tuple[Surface, Ring],
    cells: tuple[Floats, Floats],
    samples: int,
    key: tuple[int, ...],
) -> Floats:
    """(C, REPLICATES) f_r with F = 1 [1/sr], the mean over a ring of half vectors, at theta_d and phi_d.

    NaN where no half vector of the ring has light and eye above the horizon.
    """
    surface, ring = facets
    theta_d, phi_d = cells
    part = above_horizon(ring, theta_d, phi_d)
    out = np.full((len(theta_d), REPLICATES), np.nan)
    measured = np.flatnonzero(part > 0)
    out[measured] = 0
    per_chunk = max(1, CHUNK // samples)
    for first in range(0, len(measured) if len(ring.triangles) else 0, per_chunk):
        which = measured[first : first + per_chunk]
        means = seen_and_lit(bench, (surface, ring), (theta_d[which], phi_d[which]), samples, (*key, first))
        out[which] = means * (ring.density / part[which])[:, None]
    return out


def seen_and_lit(
    bench: Bench,
    facets: tuple[Surface, Ring],
    cells: tuple[Floats, Floats],
    samples: int,
    key: tuple[int, ...],
) -> Floats:
    """(C, REPLICATES) means over facets of V(l) V(v) / (4 n.l n.v)."""
    surface, ring = facets
    each = samples // REPLICATES
    random = np.random.default_rng(list(key))
    u = kronecker(random.random((len(cells[0]), REPLICATES, 3)), each).reshape(-1, 3)
    chosen = np.minimum(np.searchsorted(ring.share, u[:, 2], side="right"), len(ring.triangles) - 1)
    triangle = ring.triangles[chosen]
    l, v = around_half_vector(
        take_rows(surface.normals, triangle), *(np.repeat(angle, samples) for angle in cells)
    )
    out = np.zeros(len(triangle))
    left = np.flatnonzero((l[:, 2] > LEAST_COSINE) & (v[:, 2] > LEAST_COSINE))
    hits = bench.points_on(triangle[left], u[left, :2])
    for d in (l, v):
        is_free = np.flatnonzero(~bench.occluded(hits, column_major(d[left])))
        left, hits = left[is_free], hits.take(is_free)
    out[left] = 1 / (4 * l[left, 2] * v[left, 2])
    return out.reshape(-1, REPLICATES, each).mean(axis=-1)


def mirrored_to(
    bench: Bench,
    l: Floats,
    grid: AngleGrid,
    light: tuple[Fresnel, int],
    draw: tuple[int, tuple[int, ...]],
) -> Floats:
    """(3, C, REPLICATES) the mean of f_r, weighted with n.v, over the cells of a grid, for light from l (3,).

    Parameters
    ----------
    light
        The reflectance, and how often it counts at most.
    draw
        Rays of each replicate, and the key of the random numbers.
    """
    fresnel, bounces = light
    each, key = draw
    out = np.zeros((3, len(grid), REPLICATES))
    random = np.random.default_rng(list(key))
    shifts = random.random((REPLICATES, 2))
    for replicate in range(REPLICATES):
        points = kronecker(shifts[replicate], each)
        for first in range(0, each, CHUNK):
            u = points[first : first + CHUNK]
            d = np.broadcast_to(l, (len(u), 3)).copy(order="F")
            share = np.ones((3, len(u)))
            hits = bench.first_points(d, u)
            for _ in range(bounces):
                # Mirror those that arrive; the others have left.
                d, share, hits = d[hits.is_hit], share[:, hits.is_hit], hits.take(np.flatnonzero(hits.is_hit))
                cosine = dot(d, hits.normal)
                share = share * fresnel(np.clip(cosine, 0, 1))
                d = mirror(d, hits.normal, cosine)
                following = bench.leaving(hits, d)
                gone = np.flatnonzero(~following.is_hit & (d[:, 2] > LEAST_COSINE))
                cell = grid.cells_of(d[gone])
                for channel in range(3):
                    out[channel, :, replicate] += np.bincount(cell, share[channel, gone], len(grid))
                d, hits = -d, following
    return out / (each * grid.projected[:, None])
