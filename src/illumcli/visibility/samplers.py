"""Samplers: point sets of rays over the hemisphere. `SAMPLERS`, at the end, has a row for each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats
from illumcli.rays.pattern_rays import Patterns
from illumcli.rays.sampling import compact_spiral_table, hashed, owen, sobol, spiral_table, unit_interval
from illumcli.records import Value

Directions: TypeAlias = Callable[[NDArray[np.float64], int], NDArray[np.float32]]
GRAZING = 2.0**-20
"""Least cosine between a mirrored ray and its triangle's normal, so that rounding turns none below it."""


def variance(mu: NDArray[Any]) -> NDArray[np.float32]:
    """(M,) N times the variance of each row of mu, (M, N)."""
    mean = mu.mean(axis=1, dtype=np.float64)
    square = mean if mu.dtype == np.bool_ else np.square(mu, dtype=np.float64).mean(axis=1)
    return (mu.shape[1] * np.maximum(square - mean * mean, 0)).astype(F)


def every_ray(cosine: Floats, samples: int) -> NDArray[np.int64]:
    """(M,) `samples`: in a pattern without order any ray may point below."""
    return np.full(len(cosine), samples)


class Sampler(Value):
    """A point set over the hemisphere."""

    mark: str
    """Its marker in text plots, one letter."""
    directions: Directions
    """Function of draws, (2, M) in [0, 1), and the number of samples: (M, 3, samples) float32 cosine-weighted
    unit directions about the third axis. The draws phase or scramble each point's pattern."""
    text: str
    """What it is, for the schema."""
    shared: Callable[[NDArray[np.float64], int], Patterns] | None = None
    """The same directions as rows of a table, where points share them."""
    turned: bool = False
    """True if the pattern is also turned about the normal, by the first draw."""
    variation: Callable[[NDArray[Any]], NDArray[np.float32]] = variance
    """(M,) variation of mu, (M, samples), that predicts the error of the point set."""
    max_below: Callable[[Floats, int], NDArray[np.int64]] = every_ray
    """(M,) upper bound on the number of rays that point below a plane whose normal has this cosine, (M,), to
    the pattern's axis; they are the last rays of each pattern."""


# --- from points of the unit square -------------------------------------------------------------------


def malley(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float32]:
    """(M, 3, N) cosine-weighted directions from points (u, v) of the unit square, (M, N) each.

    Malley's method: points uniform on the disc, projected up to the hemisphere.
    """
    r, angle = np.sqrt(u), 2 * np.pi * v
    return np.stack([r * np.cos(angle), r * np.sin(angle), np.sqrt(1 - u)], axis=1).astype(F)


def owen_directions(draws: NDArray[np.float64], samples: int) -> NDArray[np.float32]:
    """Owen-scrambled Sobol points, with its own scramble for each point."""
    seeds = (draws * 2.0**32).astype(np.uint32)
    u, v = (owen(base[None, :], seed[:, None]) for base, seed in zip(sobol(samples), seeds, strict=True))
    return malley(u, v)


def random_directions(draws: NDArray[np.float64], samples: int) -> NDArray[np.float32]:
    """Independent points."""
    seeds = (draws * 2.0**32).astype(np.uint32)
    ray = np.arange(samples, dtype=np.uint32)[None, :]
    u, v = (unit_interval(hashed(k, hashed(k + 7, seeds[k])[:, None] + ray)) for k in (0, 1))
    return malley(u, v)


# --- the spiral ---------------------------------------------------------------------------------------


def spiral_directions(draws: NDArray[np.float64], samples: int) -> NDArray[np.float32]:
    """Golden-angle spirals, phased by the second draw."""
    patterns = spiral_patterns(draws, samples)
    return patterns.table.take(patterns.row, axis=0)


def spiral_patterns(draws: NDArray[np.float64], samples: int) -> Patterns:
    """The same as rows of a table that all points share."""
    table = spiral_table(samples)
    row = (draws[1] * len(table)).astype(np.int32)
    return Patterns(table, row, compact_spiral_table(samples))


def spiral_variation(mu: NDArray[Any]) -> NDArray[np.float32]:
    """(M,) sum of squared differences of mu between neighbouring rays.

    On a golden-angle spiral, points whose numbers differ by a Fibonacci number near sqrt(N) are neighbours.
    The squared differences count the cells that edges of occluders cross; only these cells contribute error.

    Parameters
    ----------
    mu : (M, N) bool or float32
        Of each point's rays in the order of the spiral.
    """
    total = np.zeros(len(mu), F)
    for step in neighbor_steps(mu.shape[1]):
        if mu.dtype == np.bool_:
            total += np.count_nonzero(mu[:, step:] != mu[:, :-step], axis=1)
        else:
            total += np.square(mu[:, step:] - mu[:, :-step]).sum(axis=1)
    return total


def neighbor_steps(samples: int) -> list[int]:
    """Two consecutive Fibonacci numbers from 3/4 sqrt(samples) on, those that are below `samples`."""
    a, b = 1, 2
    while a < 0.75 * samples**0.5:
        a, b = b, a + b
    return [step for step in (a, b) if step < samples]


def spiral_max_below(cosine: Floats, samples: int) -> NDArray[np.int64]:
    """(M,) upper bound on the number of rays below the plane.

    Ray i is at an angle s to the axis with sin^2 s = (i + phase) / samples. It can point below a plane whose
    normal is at an angle t to the axis only if sin^2 s > cos^2 t.
    """
    least = 1 / (4 * len(spiral_table(samples)))  # half of the gap between the last phase and the rim
    sine2 = 1 - np.square(np.clip(cosine, 0, 1).astype(np.float64)) + GRAZING
    return np.clip(np.ceil(sine2 * samples - least), 0, samples).astype(np.int64)


def patterns(sampler: Sampler, draws: NDArray[np.float64], samples: int) -> Patterns:
    """The pattern of each of M points, from (2, M) draws."""
    if sampler.shared is not None:
        return sampler.shared(draws, samples)
    directions = sampler.directions(draws, samples)
    return Patterns(directions, np.arange(len(directions), dtype=np.int32))


SAMPLERS: Mapping[str, Sampler] = {
    "spiral": Sampler(
        "o",
        spiral_directions,
        "golden-angle spirals, the least error on visibility.",
        shared=spiral_patterns,
        turned=True,
        variation=spiral_variation,
        max_below=spiral_max_below,
    ),
    "owen": Sampler("x", owen_directions, "Owen-scrambled Sobol points, less error where mu is smooth."),
    "random": Sampler(".", random_directions, "independent rays, for scale."),
}
"""By the name in scenes and on the command line; the first is the default."""
