"""The method `vertex`: obscurance sampled at the vertices."""

from __future__ import annotations

import numpy as np

from illumcli.arrays import F
from illumcli.baking.context import BakeContext, PointValues, SampleStatistics
from illumcli.baking.sampling import BakeSampler, ChosenSamples, RayCounts
from illumcli.baking.vertex_points import vertex_points

FINAL_PAIRS = 1 << 20
"""Number of the first scramble that measures the error of the values handed out."""


def sampled_at_vertices(context: BakeContext) -> PointValues:
    """Values at the vertices, each with its standard error."""
    settings, clock = context.settings, context.clock
    vertices = vertex_points(context.surfaces)
    points = vertices.points
    sampler = BakeSampler(
        points, context.occluders, context.method, settings.seed, context.threads, context.progress
    )
    clock.lap("points")

    # open points need no rays
    is_open = sampler.open_points()
    closed = np.flatnonzero(~is_open)
    share = len(closed) / max(len(is_open), 1)
    clock.lap("horizon")

    # how many rays each of the others casts
    if settings.target_error is None:
        chosen = ChosenSamples(np.full(len(closed), settings.samples), 0, 0)
    else:
        chosen = sampler.samples_for(closed, share, settings.target_error)
        clock.lap("pilot")
    counts = RayCounts(closed, chosen.samples)

    # their values, and the error of these from other rays
    estimates = sampler.estimate("values", counts, 0, settings.bent_normal, context.journal)
    clock.lap("cast")
    errors = sampler.errors(counts, FINAL_PAIRS)
    clock.lap("errors")

    # values of all points
    values = estimates.values
    w, error = np.ones(len(is_open), F), np.zeros(len(is_open), F)
    w[closed], error[closed] = values.w, errors.law.at(values.neighbor_variation, counts.samples)
    bent = None
    if values.bent is not None:
        bent = points.n.copy()
        bent[closed] = values.bent
    rays = {
        "pilot": chosen.pilot_rays,
        "values": estimates.rays,
        "errors": chosen.error_rays + errors.rays,
    }
    count, number = np.unique(counts.samples, return_counts=True)
    statistics = SampleStatistics(
        int(is_open.sum()),
        len(closed),
        errors.law.rmse * share**0.5,
        {purpose: cast for purpose, cast in rays.items() if cast},
        estimates.resumed,
        dict(zip(count.tolist(), number.tolist(), strict=True)),
    )
    return PointValues(vertices, w, error, bent, statistics)
