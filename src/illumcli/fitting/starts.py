"""Where a fit starts: the best points of a grid over the parameters that are not linear.

The grid is the additive recurrence of Roberts (2018), evenly spread in any number of dimensions; a colour is
one dimension, grey. At each point the linear parameters have their best values.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.fitting.linear import linear_places, with_best_linear
from illumcli.fitting.problem import Doubles, Problem
from illumcli.progress import Progress, no_progress
from illumcli.rays.sampling import kronecker

POINTS = 192
"""Of the grid."""
STARTS = 6
"""Most points at which a fit starts."""
APART = 0.12
"""The least distance of two starts, as a share of the searched range, in some dimension."""


def starts(problem: Problem, progress: Progress = no_progress) -> list[Doubles]:
    """The coordinates of the best points of the grid that are apart from each other, the best first."""
    linear = linear_places(problem)
    low, high = problem.parameters.searched()
    shares = _grid(problem, linear)
    points = []
    for number, share in enumerate(shares):
        progress("starts", number, len(shares))
        x = with_best_linear(problem, low + (high - low) * share, linear)
        points.append((float(np.square(problem.residuals(x)).sum()), number, x))
    progress("starts", len(shares), len(shares))

    # The best ones, each apart from those before it.
    chosen: list[int] = []
    found = []
    for cost, number, x in sorted(points, key=lambda point: point[:2]):
        gaps = [np.abs(shares[number] - shares[other]).max() for other in chosen]
        if np.isfinite(cost) and all(gap > APART for gap in gaps):
            chosen.append(number)
            found.append(x)
        if len(found) == STARTS:
            break
    return found


def _grid(problem: Problem, linear: NDArray[np.intp]) -> Doubles:
    """(K, P) points of the unit cube; linear coordinates are one half, as they do not matter."""
    slices = list(problem.parameters.slices())
    others = [place for _, place in slices if place.start not in linear]
    out = np.full((POINTS if others else 1, problem.parameters.count), 0.5)
    if others:
        grid = kronecker(np.full(len(others), 0.5), POINTS)
        for dimension, place in enumerate(others):
            out[:, place] = grid[:, [dimension]]
    return out
