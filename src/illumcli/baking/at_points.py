"""Channels sampled at points of any kind, each value with its standard error."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.baking.context import BakeContext, PointChannels, SampledValues, SampleStatistics
from illumcli.baking.points import Points
from illumcli.baking.reconstructed import reconstructed_values
from illumcli.baking.sampling import BakeSampler, ChosenSamples, RayCounts
from illumcli.visibility.channels import chosen

FINAL_PAIRS = 1 << 20
"""Number of the first scramble that measures the error of the values handed out."""


def channels_at(context: BakeContext, points: Points) -> PointChannels:
    """The channels that the settings ask for."""
    settings, clock = context.settings, context.clock
    sampler = BakeSampler(
        points, context.occluders, context.method, settings.seed, context.threads, context.progress
    )
    clock.lap("points")

    # open points need no rays
    is_open = sampler.open_points()
    closed = np.flatnonzero(~is_open)
    clock.lap("horizon")

    # values of the others
    sampled = (reconstructed_values if settings.reconstruct else raw_values)(context, sampler, closed)
    w, error, bent = np.ones(len(is_open), F), np.zeros(len(is_open), F), points.n.copy()
    w[closed], error[closed] = sampled.w, sampled.error
    if sampled.bent is not None:
        bent[closed] = sampled.bent
    count, number = np.unique(sampled.samples, return_counts=True)
    statistics = SampleStatistics(
        int(is_open.sum()),
        len(closed),
        sampled.rmse,
        {purpose: cast for purpose, cast in sampled.rays.items() if cast},
        sampled.resumed,
        dict(zip(count.tolist(), number.tolist(), strict=True)),
        sampled.reconstruction,
    )
    arrays = {"obscurance": w, "standard_error": error, "bent_normal": bent}
    return PointChannels(chosen(arrays, settings.what), {"obscurance": statistics})


def raw_values(context: BakeContext, sampler: BakeSampler, closed: NDArray[np.int64]) -> SampledValues:
    """Values of the points that are not open, each from its own rays alone."""
    settings, clock = context.settings, context.clock
    share = len(closed) / max(len(sampler.points.key), 1)

    # how many rays each of them casts
    if settings.target_error is None:
        counts = RayCounts(closed, np.full(len(closed), settings.samples))
        pilot = ChosenSamples(counts.samples, 0, 0)
    else:
        pilot = sampler.samples_for(closed, share, settings.target_error)
        counts = RayCounts(closed, pilot.samples)
        clock.lap("pilot")

    # their values, and the error of these from other rays
    estimates = sampler.estimate("values", counts, 0, "bent_normal" in settings.what, context.journal)
    clock.lap("cast")
    errors = sampler.errors(counts, FINAL_PAIRS)
    clock.lap("errors")
    values = estimates.values
    rays = {"pilot": pilot.pilot_rays, "values": estimates.rays, "errors": pilot.error_rays + errors.rays}
    return SampledValues(
        values.w,
        errors.law.at(values.neighbor_variation, counts.samples),
        values.bent,
        errors.law.rmse * share**0.5,
        counts.samples,
        rays,
        estimates.resumed,
    )
