"""The error of values that are written, noise and bias together, from rays that are used nowhere else.

Two more estimates C and D, of separate scrambles, are made at some points. With F the value there, the mean
of (F - C)(F - D) is an unbiased estimate of the mean square error of F: C and D err independently of F and of
each other. Points are drawn more often where errors are expected, and count less in turn.

References
----------
Horvitz, D. G. and Thompson, D. J. (1952). A generalization of sampling without replacement from a finite
universe. Journal of the American Statistical Association 47(260).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats
from illumcli.baking.sampling import BakeSampler, RayCounts
from illumcli.rays.sampling import shuffled, stream
from illumcli.records import Record, Value
from illumcli.visibility.obscurance_error import NO_HIT_QUANTILE, line

POINTS = 512
"""Points of a round."""
PRECISION = 0.05
"""Standard error of the root mean square error, as a share of it, at which the audit ends."""
MAX_ROUNDS = 24
LIMIT_SHARE, LEAST_LIMIT = 0.25, 1 << 18
"""No further round once an audit took so many of the rays of the values, but at least so many rays."""
MIN_RAYS, MAX_RAYS = 16, 4096
"""Rays of an estimate."""
FIRST_REPLICATE = 1 << 21
"""Number of the first scramble of audits."""


class ErrorLaw(Value):
    """standard error = sqrt(floor + slope * risk), fitted to an audit."""

    floor: float
    slope: float

    def at(self, risk: Floats) -> NDArray[np.float32]:
        """(M,) float32 standard errors."""
        return np.sqrt(self.floor + self.slope * risk).astype(F)


class Audit(Record):
    """The error of K values."""

    mean_square: float
    spread: float  # standard error of the mean square
    law: ErrorLaw
    draws: int  # of points; one that was drawn twice counts twice, each time with other rays
    samples: int  # rays of each estimate
    rays: int

    def rmse(self, share: float) -> float:
        """Root mean square error where the K values are a `share` of all and the others are exact; not 0
        unless it is known to be: the standard error of the mean square is the least that is stated."""
        return math.sqrt(share * max(self.mean_square, self.spread, self.law.floor))

    def interval(self, share: float) -> tuple[float, float]:
        """95 % interval of the same."""
        low, high = (max(self.mean_square + sign * 1.96 * self.spread, 0.0) for sign in (-1, 1))
        return math.sqrt(share * low), math.sqrt(share * max(high, self.law.floor))


class Audited(Record):
    """The values that are audited, of K points."""

    points: NDArray[np.int64]  # (K,)
    w: NDArray[np.float64]  # (K,)
    risk: NDArray[np.float64]  # (K,) expected square errors
    samples: float  # rays of a point, in the mean
    raw_variance: float  # mean variance of the values of so many rays before they were reconstructed


def audit(sampler: BakeSampler, values: Audited, number: int, target: float = 0.0) -> Audit:
    """The error of values from rays of their own; audits of different numbers share none.

    Rounds of 512 points are added until the root mean square error is known to 5 %, or known to be above
    `target`, a positive one.
    """
    count = len(values.points)
    if not count:
        return Audit(0.0, 0.0, ErrorLaw(0.0, 0.0), 0, 0, 0)

    # estimates as exact as the values, so that neither errs in vain
    expected = max(float(values.risk.mean()), 1e-12)
    ratio = (values.raw_variance / expected) ** (2 / 3)
    rays = int(np.clip(values.samples * ratio, MIN_RAYS, MAX_RAYS))
    chance = _chances(values.risk + expected, POINTS)
    limit = max(LIMIT_SHARE * values.samples * count, LEAST_LIMIT)

    products: list[NDArray[np.float64]] = []
    drawn: list[NDArray[np.int64]] = []
    cast = 0
    for turn in range(MAX_ROUNDS):
        replicate = FIRST_REPLICATE + 2 * (number * MAX_ROUNDS + turn)
        index = _drawn(chance, sampler.seed, replicate)
        halves = []
        for half in (0, 1):
            counts = RayCounts(values.points[index], np.full(len(index), rays))
            estimate = sampler.estimate("audit", counts, replicate + half)
            halves.append(values.w[index] - estimate.values.w)
            cast += estimate.rays
        drawn.append(index)
        products.append(halves[0] * halves[1])
        mean, spread = _mean(products, [chance[each] for each in drawn], count)
        if spread <= 2 * PRECISION * mean or cast >= limit or 0 < target**2 < mean - 3 * spread:
            break
    every = np.concatenate(drawn)
    least = (NO_HIT_QUANTILE / (2 * rays * len(every))) ** 2
    law = _law(values.risk[every], np.concatenate(products), expected, least)
    return Audit(mean, spread, law, len(every), rays, cast)


def _chances(weight: NDArray[np.float64], wanted: int) -> NDArray[np.float64]:
    """(K,) probabilities proportional to the weights, at most 1, that sum to `wanted` or are all 1."""
    chance = np.minimum(weight * (wanted / weight.sum()), 1)
    for _ in range(8):
        free = chance < 1
        if not free.any():
            break
        missing = wanted - float((~free).sum())
        chance[free] = np.minimum(weight[free] * (max(missing, 0) / weight[free].sum()), 1)
    return chance


def _drawn(chance: NDArray[np.float64], seed: int, number: int) -> NDArray[np.int64]:
    """Points drawn with these probabilities, ascending: systematic sampling in a random order, since files of
    meshes have periods of their own."""
    key = stream(seed, f"audit {number}")
    order = shuffled(key, np.arange(len(chance), dtype=np.uint32))
    offset = key * 2.0**-32
    upto = np.floor(np.cumsum(chance[order]) - offset)
    return np.sort(order[np.diff(upto, prepend=np.floor(-offset)) > 0])


def _mean(
    products: list[NDArray[np.float64]], chances: list[NDArray[np.float64]], count: int
) -> tuple[float, float]:
    """Mean of the products over all points, and its standard error."""
    weighted = np.concatenate([z / p for z, p in zip(products, chances, strict=True)])
    total = len(products) * count
    drawn = len(weighted)
    square = np.square(weighted - weighted.mean()).sum() * drawn / max(drawn - 1, 1)
    return float(weighted.sum() / total), float(np.sqrt(square) / total)


def _law(risk: NDArray[np.float64], products: NDArray[np.float64], expected: float, least: float) -> ErrorLaw:
    """The line through the products: their error is proportional to the risk."""
    floor, slope = line(risk, products, 1 / np.square(risk + expected / 4))
    return ErrorLaw(max(floor, least), slope)
