"""Values at vertices from few rays, reconstructed on the surface, with an audited error."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.baking.audit import Audit, Audited, audit
from illumcli.baking.context import BakeContext, SampledValues
from illumcli.baking.reconstruction import RawValues, Reconstruction, reconstruct
from illumcli.baking.sampling import (
    MAX_SAMPLES,
    MIN_SAMPLES,
    BakeSampler,
    RayCounts,
    averaged_along,
    rounded_samples,
)
from illumcli.records import Record
from illumcli.visibility.obscurance_error import Estimates

PAIRS = 1 << 20
"""Number of the first scramble that measures the error of raw values; each trial has 2^10 more."""
MAX_TRIALS = 8
AIM = 0.93
"""What the next trial aims at, as a share of the error asked for: an audit knows the error to 5 %."""
SLOPE, FLATTEST, STEEPEST = 0.53, 0.35, 0.9
"""Error falls like this power of the rays: as expected, and the bounds of what two trials may say."""

LEAST_GROWTH, MOST_GROWTH = 1.25, 32.0


class Trial(Record):
    """Reconstructed values of the points that are not open, for some numbers of rays."""

    samples: NDArray[np.int64]  # (K,) rays of each
    raw: Estimates
    reconstruction: Reconstruction  # of all points
    audit: Audit
    value_rays: int
    other_rays: dict[str, int]  # purpose -> rays
    resumed: int


def reconstructed_values(
    context: BakeContext, sampler: BakeSampler, closed: NDArray[np.int64]
) -> SampledValues:
    """Values of the points that are not open, reconstructed; with a target, by as many rays as it takes.

    Trials with more and more rays are audited until one has reached the target. Each is sampled anew.
    """
    target = context.settings.target_error
    if target is None:
        samples = np.full(len(closed), context.settings.samples)
        return _values(context, sampler, closed, [_trial(context, sampler, RayCounts(closed, samples), 0)])

    count = len(sampler.points.key)
    share = len(closed) / max(count, 1)
    samples, weight = np.full(len(closed), MIN_SAMPLES), np.ones(len(closed))
    trials: list[Trial] = []
    for number in range(MAX_TRIALS):
        trial = _trial(context, sampler, RayCounts(closed, samples), number)
        trials.append(trial)
        is_reached = trial.audit.rmse(share) <= target
        if is_reached or samples.min(initial=MAX_SAMPLES) >= MAX_SAMPLES:
            break
        if number == 0:
            # more rays where neighbouring rays disagree, as without reconstruction
            near = averaged_along(sampler.order, closed, trial.raw.neighbor_variation, count)
            weight = (1 + near) ** 0.4
            weight /= weight.mean()
        growth = _growth(trials, AIM * target / share**0.5)
        samples = rounded_samples(weight * samples.mean() * growth)
    return _values(context, sampler, closed, trials)


def _trial(context: BakeContext, sampler: BakeSampler, counts: RayCounts, number: int) -> Trial:
    """Values of so many rays, reconstructed and audited."""
    settings, clock = context.settings, context.clock
    closed, points = counts.points, sampler.points

    # raw values and their errors
    raw = sampler.estimate("values", counts, 0, settings.bent_normal, context.journal)
    clock.lap("cast")
    errors = sampler.errors(counts, PAIRS + (number << 10))
    clock.lap("errors")
    hidden, variance = np.zeros(len(points.key)), np.zeros(len(points.key))
    hidden[closed] = 1 - raw.values.w.astype(np.float64)
    variance[closed] = np.square(
        errors.law.at(raw.values.neighbor_variation, counts.samples), dtype=np.float64
    )

    # reconstructed values and theirs
    reconstruction = reconstruct(points, RawValues(hidden, variance), context.threads)
    clock.lap("reconstruct")
    values = Audited(
        closed,
        _written(reconstruction, closed).astype(np.float64),
        reconstruction.risk[closed],
        math.ceil(counts.samples.mean()) if len(closed) else 0,
        float(variance[closed].mean()) if len(closed) else 0.0,
    )
    share = len(closed) / max(len(points.key), 1)
    found = audit(sampler, values, number, (settings.target_error or 0.0) / max(share, 1e-9) ** 0.5)
    clock.lap("audit")
    cast = {"errors": errors.rays, "audit": found.rays}
    return Trial(counts.samples, raw.values, reconstruction, found, raw.rays, cast, raw.resumed)


def _written(reconstruction: Reconstruction, closed: NDArray[np.int64]) -> NDArray[np.float32]:
    """(K,) float32 the reconstructed w."""
    return (1 - reconstruction.hidden[closed]).astype(F)


def _growth(trials: list[Trial], aim: float) -> float:
    """How many times as many rays the next trial casts."""
    last, slope = trials[-1], SLOPE
    if len(trials) > 1:
        before = trials[-2]
        gain = math.log(before.audit.rmse(1) / last.audit.rmse(1))
        more = math.log(float(last.samples.mean() / before.samples.mean()))
        slope = min(max(gain / more, FLATTEST), STEEPEST)
    return min(max((last.audit.rmse(1) / aim) ** (1 / slope), LEAST_GROWTH), MOST_GROWTH)


def _values(
    context: BakeContext, sampler: BakeSampler, closed: NDArray[np.int64], trials: list[Trial]
) -> SampledValues:
    """What is written of the last trial, and what all of them took."""
    last = trials[-1]
    share = len(closed) / max(len(sampler.points.key), 1)
    low, high = last.audit.interval(share)
    about: dict[str, Any] = {
        "windows": {str(points): round(each, 4) for points, each in last.reconstruction.windows.items()},
        "audit": {
            "interval": [low, high],
            "estimates": last.audit.points,
            "samples": last.audit.samples,
        },
    }
    rays = {
        "trials": sum(trial.value_rays for trial in trials[:-1]),
        "values": last.value_rays,
        "errors": sum(trial.other_rays["errors"] for trial in trials),
        "audit": sum(trial.other_rays["audit"] for trial in trials),
    }
    return SampledValues(
        _written(last.reconstruction, closed),
        last.audit.law.at(last.reconstruction.risk[closed]),
        last.raw.bent,
        last.audit.rmse(share),
        last.samples,
        rays,
        sum(trial.resumed for trial in trials),
        about,
    )
