"""The least squares fit from several starts: trust-region Gauss-Newton steps within the limits.

Starts are refined on a part of the pairs; the best goes on with all. Parameters that end at a limit are
set to it, and the others are fitted again. Where only a combination of several parameters is determined,
such as the common scale of Lafortune's weights, whose effect the height of the lobe undoes, one of them
is held at a limit of its range if that fits as well.

References
----------
Branch, M. A., Coleman, T. F., Li, Y. (1999). A subspace, interior, and conjugate gradient method for
large-scale bound-constrained minimization problems. SIAM J. Sci. Comput. 21(1): scipy's least_squares.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from illumcli.fitting.determinacy import directions_of
from illumcli.fitting.problem import Doubles, Problem, part_of
from illumcli.fitting.starts import starts
from illumcli.progress import Progress, no_progress
from illumcli.records import Record

ROUGH_PAIRS = 2500
"""Most pairs on which starts are found and refined."""
SAME = 1e-3
"""Two starts have reached the same optimum if their errors differ by no more, relatively."""
NEAR = 1e-3
"""A coordinate this near to a limit is tried at it."""
CONVERGED = 1e-10
"""Relative change of the squared error at which a fit ends."""


class Steps(NamedTuple):
    """When a fit ends."""

    most: int
    tolerance: float


ROUGH, FINE = Steps(40, 1e-6), Steps(200, CONVERGED)


class Optimum(Record):
    """Where a fit ended."""

    x: Doubles
    """(P,) coordinates."""
    at_limit: NDArray[np.bool_]
    """(P,) True where the range of a parameter ends there."""
    chosen: NDArray[np.bool_]
    """(P,) True where a parameter is held at a limit, because others make up for it."""
    starts: int
    """The number of starts."""
    reached: int
    """How many of them reached this optimum, within `SAME` of its error."""

    @property
    def is_held(self) -> NDArray[np.bool_]:
        """(P,) True where a coordinate is not free."""
        return self.at_limit | self.chosen


def solve(problem: Problem, progress: Progress = no_progress) -> Optimum:
    """The best fit that any of the starts reaches."""
    rough = part_of(problem, ROUGH_PAIRS)
    ends = []
    points = starts(rough, progress)
    for number, x in enumerate(points):
        progress("fits", number, len(points) + 1)
        x = _descended(rough, x, np.zeros(len(x), np.bool_), ROUGH)
        ends.append((float(np.square(rough.residuals(x)).sum()), number, x))
    ends.sort(key=lambda end: end[:2])
    best = np.sqrt(ends[0][0])
    reached = int(sum(np.sqrt(cost) <= best * (1 + SAME) + 1e-12 for cost, _, _ in ends))
    progress("fits", len(points), len(points) + 1)
    held = np.zeros(problem.parameters.count, np.bool_)
    x, at_limit = within_limits(problem, ends[0][2], held)
    x, at_limit, chosen = _settled(problem, x, at_limit)
    progress("fits", len(points) + 1, len(points) + 1)
    return Optimum(x, at_limit, chosen, len(points), reached)


def _settled(
    problem: Problem, x: Doubles, at_limit: NDArray[np.bool_]
) -> tuple[Doubles, NDArray[np.bool_], NDArray[np.bool_]]:
    """The optimum with a parameter of each undetermined combination held at a limit, and which these are."""
    chosen = np.zeros(len(x), np.bool_)
    low, high = problem.parameters.limits()
    bounded = np.concatenate([np.full(each.width, each.high <= 1e3) for each in problem.parameters.free])
    for _ in range(len(x)):
        free = np.flatnonzero(~(at_limit | chosen))
        if not free.size:
            break
        directions = directions_of(problem, x, free)
        combinations = list(map(directions.members, directions.axes[directions.is_null]))
        places = [p for members in combinations if members.sum() > 1 for p in free[members] if bounded[p]]
        for place, limit in [(p, side[p]) for p in places for side in (high, low)]:
            tried, holds = x.copy(), at_limit | chosen
            tried[place], holds[place] = limit, True
            tried, others = within_limits(problem, tried, holds)
            if _is_as_good(problem, tried, x):
                chosen[place] = True
                x, at_limit = tried, others & ~chosen
                break
        else:
            break
    return x, at_limit, chosen


def within_limits(problem: Problem, x: Doubles, held: NDArray[np.bool_]) -> tuple[Doubles, NDArray[np.bool_]]:
    """The optimum near `x` with some coordinates held, and which of all are held in the end."""
    low, high = problem.parameters.limits()
    for _ in range(len(x) + 1):
        x = _descended(problem, x, held, FINE)

        # Hold coordinates that fit as well at the limits that they are near to.
        before = held
        for place in np.flatnonzero(~held & ((x - low < NEAR) | (high - x < NEAR))):
            at = x.copy()
            at[place] = low[place] if x[place] - low[place] < NEAR else high[place]
            if _is_as_good(problem, at, x):
                x, held = at, held | (np.arange(len(x)) == place)
        if np.array_equal(before, held):
            break
    return x, held


def _is_as_good(problem: Problem, one: Doubles, other: Doubles) -> bool:
    """Is the error of some coordinates no larger than that of others, but for rounding?"""
    rounding = CONVERGED**2 * np.square(problem.data).mean()
    error, limit = (float(np.square(problem.residuals(x)).sum()) for x in (one, other))
    return error <= limit * (1 + CONVERGED**0.5) + rounding


def _descended(problem: Problem, x: Doubles, held: NDArray[np.bool_], steps: Steps) -> Doubles:
    """The coordinates after the least squares steps; those that are `held` stay."""
    from scipy.optimize import least_squares

    free = np.flatnonzero(~held)
    if not free.size:
        return x

    def whole(part: Doubles) -> Doubles:
        out = x.copy()
        out[free] = part
        return out

    low, high = (limit[free] for limit in problem.parameters.limits())
    # where a fit is exact, scipy divides by a gradient of 0; it rejects the step and keeps the coordinates
    with np.errstate(divide="ignore", invalid="ignore"):
        found = least_squares(
            lambda part: problem.residuals(whole(part)),
            x[free],
            lambda part: problem.jacobian(whole(part))[:, free],
            bounds=(low, high),
            x_scale="jac",
            ftol=steps.tolerance,
            xtol=steps.tolerance,
            gtol=None,
            max_nfev=steps.most,
        )
    return whole(np.clip(found.x, low, high))
