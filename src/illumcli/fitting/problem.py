"""A fit as a least squares problem: coordinates of parameters in, weighted residuals out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from illumcli.fitting.measurement import Measurement
from illumcli.fitting.metrics import TRANSFORMS
from illumcli.fitting.parameters import Parameters
from illumcli.fitting.responder import Responder
from illumcli.models._base import IlluminationModel
from illumcli.records import Record

Doubles = NDArray[np.float64]
STEP = 1e-6
"""Of a central difference, in coordinates; its error is of order STEP^2, that of rounding of 1e-16 / STEP."""
TRIED_PAIRS = 500
"""Most pairs at which properties of a model are tried."""


class Problem(Record):
    """A model to be fitted to data."""

    model: IlluminationModel
    """With the values of all parameters that are not fitted."""
    parameters: Parameters
    metric: str
    responder: Responder
    data: Doubles
    """(N, 3) measured f_r n.l."""
    weight: Doubles
    """(N,) of sum 1."""
    unmixed: frozenset[str] = frozenset()
    """Paths of the colours of which each channel changes the same channel of the response alone."""

    def response(self, x: Doubles) -> Doubles:
        """(N, 3) the model's f_r n.l."""
        return self.responder.response(self.model.at(self.parameters.values(x)))

    def residuals(self, x: Doubles) -> Doubles:
        """(3 N,) residuals whose sum of squares is the square of the metric."""
        transform = TRANSFORMS[self.metric]
        gap = transform(self.response(x)) - transform(self.data)
        return (gap * np.sqrt(self.weight / 3)[:, None]).ravel()

    def jacobian(self, x: Doubles) -> Doubles:
        """(3 N, P) derivatives of the residuals by the coordinates, one-sided at limits."""
        low, high = self.parameters.limits()
        out = np.zeros((*self.data.shape, len(x)))
        for places in self.together():
            above, below = x.copy(), x.copy()
            step = STEP * np.maximum(np.abs(x[places]), 1)
            above[places] = np.minimum(x[places] + step, high[places])
            below[places] = np.maximum(x[places] - step, low[places])
            change = (self.residuals(above) - self.residuals(below)).reshape(self.data.shape)
            put_columns(out, places, change, (above - below)[places])
        return out.reshape(-1, len(x))

    def together(self) -> Iterator[NDArray[np.intp]]:
        """Coordinates whose effects on the response one change of all of them shows."""
        for each, place in self.parameters.slices():
            coordinates = np.arange(place.start, place.stop)
            yield from [coordinates] if each.path in self.unmixed else coordinates[:, None]


def put_columns(out: Doubles, places: NDArray[np.intp], change: Doubles, steps: Doubles) -> None:
    """Put the derivatives by the coordinates `places`, which were changed together, into `out`.

    Parameters
    ----------
    out : ndarray
        (N, 3, P) of zeros.
    change : ndarray
        (N, 3) of the channels; if there are several places, each is that of its channel.
    steps : ndarray
        The change of each coordinate.
    """
    if len(places) == 1:
        out[..., places[0]] = change / steps[0]
    else:
        for channel, place in enumerate(places):
            out[:, channel, place] = change[:, channel] / steps[channel]


def problem_of(
    model: IlluminationModel, parameters: Parameters, metric: str, measurement: Measurement
) -> Problem:
    """The problem of a whole measurement."""
    problem = Problem(
        model=model,
        parameters=parameters,
        metric=metric,
        responder=Responder(measurement.l, measurement.v),
        data=measurement.values * measurement.l[:, 2:],
        weight=measurement.weight,
    )
    colors = [(each, place) for each, place in parameters.slices() if each.width == 3]
    few = part_of(problem, TRIED_PAIRS)
    return replace(problem, unmixed=frozenset(each.path for each, place in colors if _is_unmixed(few, place)))


def part_of(problem: Problem, most: int, seed: int = 0) -> Problem:
    """The problem with at most so many of the pairs, drawn at random."""
    count = len(problem.data)
    if count <= most:
        return problem
    rows = np.sort(np.random.default_rng(seed).choice(count, most, replace=False))
    weight, pairs = problem.weight[rows], problem.responder
    return replace(
        problem,
        responder=Responder(pairs.l[rows], pairs.v[rows]),
        data=problem.data[rows],
        weight=weight / weight.sum(),
    )


def _is_unmixed(problem: Problem, place: slice, seed: int = 0) -> bool:
    """Does each channel of a colour change the same channel of the response alone, at random parameters?"""
    random = np.random.default_rng(seed)
    low, high = problem.parameters.searched()
    for channel in np.repeat(range(3), 2):
        x = low + (high - low) * random.random(len(low))
        others = np.delete(problem.response(x), channel, axis=1)
        x[place.start + channel] = low[place.start] + (high - low)[place.start] * random.random()
        if np.any(np.delete(problem.response(x), channel, axis=1) != others):
            return False
    return True
