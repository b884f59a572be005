"""Values at vertices from few rays, reconstructed on the surface, with an audited error."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Vectors
from illumcli.baking.audit import Audit, Audited, audit
from illumcli.baking.cells import Cells
from illumcli.baking.context import BakeContext, SampledValues
from illumcli.baking.reconstruction import RawValues, reconstruct
from illumcli.baking.sampling import (
    MAX_SAMPLES,
    MIN_SAMPLES,
    BakeSampler,
    PointEstimates,
    RayCounts,
    averaged_along,
    rounded_samples,
)
from illumcli.records import Record

PAIRS = 1 << 20
"""Number of the first scramble that measures the error of raw values; each trial has 2^10 more."""
MAX_TRIALS = 8
AIM = 0.93
"""What the next trial aims at, as a share of the error asked for: an audit knows the error to 5 %."""
SLOPE, FLATTEST, STEEPEST = 0.57, 0.35, 0.9
"""Error falls like this power of the rays: as expected, and the bounds of what two trials may say."""

LEAST_GROWTH, MOST_GROWTH = 1.25, 32.0


def reconstructed_values(
    context: BakeContext, sampler: BakeSampler, closed: NDArray[np.int64], cells: Sequence[Cells]
) -> SampledValues:
    """Values of the points that are not open, reconstructed; with a target, by as many rays as it takes.

    Trials with more and more rays are audited until one has reached the target. Each is sampled anew.
    """
    bake = ReconstructedBake(context, sampler, closed, cells)
    target = context.settings.target_error
    if target is None:
        return bake.values([bake.trial(np.full(len(closed), context.settings.samples), 0)])

    trials: list[Trial] = []
    samples, weight = np.full(len(closed), MIN_SAMPLES), np.ones(len(closed))
    for number in range(MAX_TRIALS):
        trials.append(bake.trial(samples, number))
        is_reached = trials[-1].audit.rmse(bake.share) <= target
        if is_reached or samples.min(initial=MAX_SAMPLES) >= MAX_SAMPLES:
            break
        if number == 0:
            weight = bake.ray_weights(trials[0])
        growth = _growth(trials, AIM * target / bake.share**0.5)
        samples = rounded_samples(weight * samples.mean() * growth)
    return bake.values(trials)


class Trial(Record):
    """Reconstructed values of the points that are not open, for some numbers of rays."""

    samples: NDArray[np.int64]  # (K,) rays of each
    raw: PointEstimates
    w: NDArray[np.float32]  # (K,)
    risk: NDArray[np.float64]  # (K,)
    bent: Vectors | None  # (K, 3)
    windows: Mapping[int, float]  # points in a window -> share of the cells
    audit: Audit
    error_rays: int


class ReconstructedBake(Record):
    """The points of a bake that are not open, and the cells of all."""

    context: BakeContext
    sampler: BakeSampler
    closed: NDArray[np.int64]  # (K,)
    cells: Sequence[Cells]

    @property
    def share(self) -> float:
        """Of the points, those that are not open."""
        return len(self.closed) / max(len(self.sampler.points.key), 1)

    def trial(self, samples: NDArray[np.int64], number: int) -> Trial:
        """Values of so many rays per point, reconstructed and audited."""
        context, sampler, closed = self.context, self.sampler, self.closed
        clock, points = context.clock, sampler.points
        counts = RayCounts(closed, samples)

        # raw values and their errors
        raw = sampler.estimate("values", counts, 0, sampler.measure.with_bent, context.journal)
        clock.lap("cast")
        errors = sampler.errors(counts, PAIRS + (number << 10))
        clock.lap("errors")
        hidden, variance = np.zeros(len(points.key)), np.zeros(len(points.key))
        hidden[closed] = 1 - raw.values.w.astype(np.float64)
        stated = errors.law.at(raw.values.neighbor_variation, samples)
        variance[closed] = np.square(stated, dtype=np.float64)

        bent = None
        if raw.values.bent is not None:
            bent = points.n.copy()
            bent[closed] = raw.values.bent

        # reconstructed values and their risk
        fit = reconstruct(points, self.cells, RawValues(hidden, variance, bent), context.threads)
        w, risk = (1 - fit.hidden[closed]).astype(F), fit.risk[closed]
        clock.lap("reconstruct")
        mean_samples, mean_variance = (
            float(each.sum() / max(len(closed), 1)) for each in (samples, variance)
        )
        values = Audited(closed, w.astype(np.float64), risk, mean_samples, mean_variance)
        target = (context.settings.target_error or 0.0) / max(self.share, 1e-9) ** 0.5
        measured = audit(sampler, values, number, target)
        clock.lap("audit")
        directions = None if fit.bent is None else fit.bent[closed]
        return Trial(samples, raw, w, risk, directions, fit.windows, measured, errors.rays)

    def ray_weights(self, trial: Trial) -> NDArray[np.float64]:
        """(K,) rays of each point for the least error, over their mean: more where neighbour rays disagree,
        as without reconstruction."""
        variation = trial.raw.values.neighbor_variation
        weight = (1 + averaged_along(self.sampler.points.order, self.closed, variation)) ** 0.4
        return np.divide(weight, weight.mean())

    def values(self, trials: Sequence[Trial]) -> SampledValues:
        """What is written of the last trial, and what all of them took."""
        last = trials[-1]
        measured = last.audit
        low, high = measured.interval(self.share)
        about: dict[str, Any] = {
            "windows": {str(points): round(share, 4) for points, share in last.windows.items()},
            "audit": {
                "low": low,
                "high": high,
                "draws": measured.draws,
                "samples": measured.samples,
            },
        }
        rays = {
            "trials": sum(trial.raw.rays for trial in trials[:-1]),
            "values": last.raw.rays,
            "errors": sum(trial.error_rays for trial in trials),
            "audit": sum(trial.audit.rays for trial in trials),
        }
        return SampledValues(
            last.w,
            measured.law.at(last.risk),
            last.bent,
            measured.rmse(self.share),
            last.samples,
            rays,
            sum(trial.raw.resumed for trial in trials),
            about,
        )


def _growth(trials: Sequence[Trial], aim: float) -> float:
    """How many times as many rays the next trial casts."""
    last, slope = trials[-1], SLOPE
    if len(trials) > 1:
        before = trials[-2]
        gain = math.log(before.audit.rmse(1) / last.audit.rmse(1))
        more = math.log(float(last.samples.mean() / before.samples.mean()))
        slope = min(max(gain / more, FLATTEST), STEEPEST)
    return min(max((last.audit.rmse(1) / aim) ** (1 / slope), LEAST_GROWTH), MOST_GROWTH)
