"""Parameters that the response is linear in: the best ones for given others are a small linear problem.

For the metric `cosine` this eliminates them from the search (variable projection, Golub and Pereyra
1973); for the others it gives a start. Which parameters are linear is found by trying, not by their
names: the response half way between two settings must be the mean of theirs.

References
----------
Golub, G. H., Pereyra, V. (1973). The differentiation of pseudo-inverses and nonlinear least squares problems
whose variables separate. SIAM J. Numer. Anal. 10(2).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.fitting.problem import TRIED_PAIRS, Doubles, Problem, part_of, put_columns

TRIALS = 4


def linear_places(problem: Problem, seed: int = 0) -> NDArray[np.intp]:
    """Numbers of the coordinates in which, jointly, the response is linear."""
    random, few = np.random.default_rng(seed), part_of(problem, TRIED_PAIRS)
    linear: list[int] = []
    for each, place in problem.parameters.slices():
        tried = [*linear, *range(place.start, place.stop)]
        if each.scale == "linear" and all(_is_affine(few, tried, random) for _ in range(TRIALS)):
            linear = tried
    return np.array(linear, np.intp)


def _is_affine(problem: Problem, places: list[int], random: np.random.Generator) -> bool:
    """Is the response half way between two random settings of these coordinates the mean of both?"""
    low, high = problem.parameters.searched()
    one = low + (high - low) * random.random(len(low))
    other, middle = one.copy(), one.copy()
    other[places] = (low + (high - low) * random.random(len(low)))[places]
    middle[places] = (one[places] + other[places]) / 2
    a, b, between = (problem.response(x) for x in (one, other, middle))
    return bool(np.all(np.abs(a + b - 2 * between) <= 1e-9 * np.maximum(a, b).max()))


def with_best_linear(problem: Problem, x: Doubles, places: NDArray[np.intp]) -> Doubles:
    """The coordinates with those of `places` replaced by the best ones under the metric `cosine`."""
    from scipy.optimize import lsq_linear

    if not len(places):
        return x
    # The response at their lowest values, and its change by each.
    low, high = (limit[places] for limit in problem.parameters.limits())
    at_low = x.copy()
    at_low[places] = low
    base = problem.response(at_low)
    step = np.minimum(1.0, high - low)
    columns = np.zeros((*base.shape, len(x)))
    for together in problem.together():
        if together[0] in places:
            stepped = at_low.copy()
            size = step[np.searchsorted(places, together)]
            stepped[together] += size
            put_columns(columns, together, problem.response(stepped) - base, size)

    # The normal equations as a square system, which has the same minimum within the limits.
    A = columns[..., places].reshape(-1, len(places)) * np.repeat(np.sqrt(problem.weight), 3)[:, None]
    b = ((problem.data - base) * np.sqrt(problem.weight)[:, None]).ravel()
    size = np.sqrt(np.maximum(np.einsum("ij,ij->j", A, A), np.finfo(np.float64).tiny))
    A /= size
    values, vectors = np.linalg.eigh(A.T @ A)
    root = np.sqrt(np.maximum(values, 1e-14))
    found = lsq_linear(
        root[:, None] * vectors.T, vectors.T @ (A.T @ b) / root, (0 * low, (high - low) * size), method="bvls"
    )
    out = x.copy()
    out[places] = np.clip(low + found.x / size, low, high)
    return out
