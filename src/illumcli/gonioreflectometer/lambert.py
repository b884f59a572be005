"""Lambertian facets at chosen directions: what every bounce adds, per power of the albedo."""

from __future__ import annotations

import numpy as np

from illumcli.arrays import Floats, Vectors, column_major, dot
from illumcli.gonioreflectometer.bench import Bench
from illumcli.gonioreflectometer.directions import about, turned
from illumcli.gonioreflectometer.estimate import REPLICATES
from illumcli.rays.sampling import kronecker
from illumcli.records import Value

CHUNK = 1 << 17
"""Samples that are followed together."""


class LambertSettings(Value):
    """How light is followed."""

    bounces: int
    is_turned: bool
    """The mean over all turns of the surface about the normal."""
    key: tuple[int, ...]
    """Of the random numbers."""


def lambert_orders(bench: Bench, l: Vectors, v: Vectors, samples: int, settings: LambertSettings) -> Floats:
    """(bounces, C, REPLICATES) what each order reflects with an albedo of 1 [1/sr], at (C, 3) l and v.

    Parameters
    ----------
    samples : int
        Of each cell, a multiple of REPLICATES.
    """
    out = np.empty((settings.bounces, len(l), REPLICATES))
    per_chunk = max(1, CHUNK // samples)
    for first in range(0, len(l), per_chunk):
        part = slice(first, first + per_chunk)
        out[:, part] = _chunk(bench, l[part], v[part], samples, (settings, first))
    return out


def _chunk(bench: Bench, l: Vectors, v: Vectors, samples: int, place: tuple[LambertSettings, int]) -> Floats:
    settings, first = place
    each = samples // REPLICATES
    random = np.random.default_rng([*settings.key, first])
    u = kronecker(random.random((len(l), REPLICATES, 3)), each).reshape(-1, 3)
    l, v = (np.repeat(column_major(d), samples, axis=0) for d in (l, v))
    n_l = l[:, 2]
    if settings.is_turned:
        l, v = (turned(d, 2 * np.pi * u[:, 2]) for d in (l, v))
    out = np.zeros((settings.bounces, len(l)))
    left = np.arange(len(l))
    hits = bench.first_points(v, u[:, :2])
    for order in range(settings.bounces):
        # The points that the paths have reached.
        reached = np.flatnonzero(hits.is_hit)
        left, hits = left[reached], hits.take(reached)
        if not len(left):
            break

        # What they reflect of the light that reaches them.
        m_l = dot(hits.normal, l[left])
        lit = np.flatnonzero(m_l > 0)
        lit = lit[~bench.occluded(hits.take(lit), l[left[lit]])]
        out[order, left[lit]] = m_l[lit] / (np.pi * n_l[left[lit]])

        # On to the next points.
        if order + 1 < settings.bounces:
            r, angle = np.sqrt(random.random(len(left))), 2 * np.pi * random.random(len(left))
            local = np.stack([r * np.cos(angle), r * np.sin(angle), np.sqrt(1 - r * r)], axis=1)
            hits = bench.leaving(hits, about(hits.normal, local))
    return out.reshape(settings.bounces, -1, REPLICATES, each).mean(axis=-1)
