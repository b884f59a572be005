"""Channels sampled at points of any kind, each value with its standard error."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F
from illumcli.baking.context import BakeContext, PointChannels, SampledValues, SampleStatistics
from illumcli.baking.measures import Measure
from illumcli.baking.points import Points
from illumcli.baking.reconstructed import reconstructed_values
from illumcli.baking.reconstruction import rotated_cells
from illumcli.baking.sampling import BakeSampler, ChosenSamples, RayCounts
from illumcli.visibility.channels import chosen

Estimate: TypeAlias = Callable[[BakeContext, BakeSampler, NDArray[np.int64]], SampledValues]
"""Values of the points that are not open, by their indices."""
FINAL_PAIRS = 1 << 20
"""Number of the first scramble that measures the error of the values handed out."""


def channels_at(context: BakeContext, points: Points) -> PointChannels:
    """The channels that the settings ask for."""
    context.clock.lap("points")

    # all values at these points are reconstructed over the same cells
    estimate: Estimate = raw_values
    if context.settings.reconstruct:
        estimate = partial(reconstructed_values, cells=rotated_cells(points, context.threads))
        context.clock.lap("cells")

    arrays: dict[str, NDArray[np.float32]] = {}
    statistics: dict[str, SampleStatistics] = {}
    for measure in context.measures:
        sampled, statistics[measure.channel] = _channels_of(context, points, measure, estimate)
        arrays |= sampled
    return PointChannels(chosen(arrays, context.settings.what), statistics)


def _channels_of(
    context: BakeContext, points: Points, measure: Measure, estimate: Estimate
) -> tuple[dict[str, NDArray[np.float32]], SampleStatistics]:
    """The channels of one measure, and what they took."""
    settings, clock = context.settings, context.clock
    sampler = BakeSampler(
        points,
        context.occluders,
        measure,
        settings.seed,
        context.threads,
        context.progress,
        is_dithered=settings.reconstruct,
    )

    # open points need no rays
    is_open = sampler.open_points()
    closed = np.flatnonzero(~is_open)
    clock.lap("horizon")

    # values of the others
    sampled = estimate(context, sampler, closed)
    mean, error = np.ones(len(is_open), F), np.zeros(len(is_open), F)
    mean[closed], error[closed] = sampled.w, sampled.error
    scale = F(measure.scale)
    channels = {measure.channel: scale * mean, measure.error: scale * error}
    if sampled.bent is not None:
        channels["bent_normal"] = points.n.copy()
        channels["bent_normal"][closed] = sampled.bent
    return channels, _statistics(sampled, measure, len(is_open), settings.target_error)


def _statistics(
    sampled: SampledValues, measure: Measure, points: int, target: float | None
) -> SampleStatistics:
    """What the values of so many points took, in units of the channel."""
    scale, reconstruction = measure.scale, sampled.reconstruction
    if reconstruction is not None:
        audit = reconstruction["audit"]
        scaled = {name: scale * audit[name] for name in ("low", "high")}
        reconstruction = {**reconstruction, "audit": {**audit, **scaled}}
    count, number = np.unique(sampled.samples, return_counts=True)
    return SampleStatistics(
        open=points - len(sampled.samples),
        cast=len(sampled.samples),
        rmse=scale * sampled.rmse,
        target=None if target is None else scale * target,
        scale=scale,
        rays={purpose: cast for purpose, cast in sampled.rays.items() if cast},
        resumed=sampled.resumed,
        samples=dict(zip(count.tolist(), number.tolist(), strict=True)),
        reconstruction=reconstruction,
    )


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
    estimates = sampler.estimate("values", counts, 0, sampler.measure.with_bent, context.journal)
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
