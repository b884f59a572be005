"""Runs, points and curves of a convergence measurement, and the line through a curve in logarithms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import median

import numpy as np
from numpy.typing import NDArray

from illumcli.accuracy.sampled import Sampling
from illumcli.records import Value


class Run(Value):
    """One image."""

    repeat: int
    seed: int
    rays: int
    seconds: float
    rmse: float
    """Against the reference, whose own error is subtracted."""
    content: str
    """Hash of everything that the error depends on."""


class Point(Value):
    """All repeats at one sampling."""

    pixel: int
    obscurance: int
    count: int  # samples or rays per pixel; doubles from point to point
    rays: int
    seconds: float  # median
    rmse: float  # over all repeats
    spread: float  # standard error of `rmse`, nan for a single repeat
    runs: tuple[Run, ...]


class Curve(Value):
    """A sampler's points and the line log rmse = constant + slope * log count through its runs."""

    sampler: str
    points: tuple[Point, ...]
    slope: float
    slope_error: float  # standard error
    constant: float

    def count_for(self, rmse: float) -> float:
        """Number of samples with this error, from the fitted line; nan if there is none."""
        if not (rmse > 0 and self.slope < 0):
            return math.nan
        return math.exp((math.log(rmse) - self.constant) / self.slope)


def rmse_of(values: NDArray[np.float32], truth: NDArray[np.float64], reference: float) -> float:
    """Root mean squared difference, with the squared error of the reference subtracted; at least 0."""
    square = np.square(values - truth).mean() - reference**2
    return math.sqrt(max(float(square), 0.0))


def point_of(sampling: Sampling, count: int, runs: Sequence[Run]) -> Point:
    """The point of all repeats at one sampling."""
    errors = np.array([run.rmse for run in runs])
    pooled = math.sqrt(np.square(errors).mean())
    spread = float(errors.std(ddof=1) / math.sqrt(len(errors))) if len(errors) > 1 else math.nan
    rays, seconds = round(median(run.rays for run in runs)), median(run.seconds for run in runs)
    return Point(sampling.pixel, sampling.obscurance, count, rays, seconds, pooled, spread, tuple(runs))


def curve_through(sampler: str, points: Sequence[Point]) -> Curve:
    """The points with the line through all runs that have an error."""
    pairs = [(math.log(p.count), math.log(run.rmse)) for p in points for run in p.runs if run.rmse > 0]
    slope, error, constant = fit_line(pairs)
    return Curve(sampler, tuple(points), slope, error, constant)


def fit_line(pairs: Sequence[tuple[float, float]]) -> tuple[float, float, float]:
    """Slope, its standard error and constant by least squares; nan if the pairs do not determine them."""
    x, y = np.array(pairs, np.float64).reshape(-1, 2).T
    squares = float(np.square(x - x.mean()).sum()) if len(x) else 0.0
    if squares == 0:
        return math.nan, math.nan, math.nan
    slope = float(((x - x.mean()) * (y - y.mean())).sum()) / squares
    constant = float(y.mean() - slope * x.mean())
    residual = float(np.square(y - constant - slope * x).sum())
    error = math.sqrt(residual / (len(x) - 2) / squares) if len(x) > 2 else math.nan
    return slope, error, constant
