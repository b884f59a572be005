"""First-order regression of the hidden share 1 - w on six features: the normal that w is taken about and the
position.

Moments of a few samples each are summed, and a polynomial is fitted to every sum by least squares. All
operations are elementwise over the sums: a polynomial depends on its own sum alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.records import Record

Planes: TypeAlias = NDArray[np.float64]  # (planes, ...), such as rows and columns
Triangle: TypeAlias = dict[tuple[int, int], NDArray[np.float64]]  # (i, j), j < i, of a 6 x 6 matrix

NORMAL_RIDGE, POSITION_RIDGE = 1e-6, 1e-6
"""Added to the variances of normals, and of positions as a share of their sum: what does not vary within a
window gets no slope."""
ROUNDING = 4e-14
"""Least ridge of positions: the variance of their rounding [radii^2]."""

FEATURES = 6
"""Three components of the normal, three of the position."""
PAIRS = tuple((i, j) for i in range(FEATURES) for j in range(i + 1))
# moments: number of samples, features, their products, hidden share, with features, its square
COUNT, FEATURE, PAIR = 0, 1, 1 + FEATURES
HIDDEN = PAIR + len(PAIRS)
HIDDEN_FEATURE = HIDDEN + 1
SQUARE = HIDDEN_FEATURE + FEATURES
MOMENTS = SQUARE + 1


def moments(
    share: NDArray[np.float64],
    hidden: NDArray[np.float64],
    features: Planes,
    add: Callable[[NDArray[np.float64], NDArray[np.float64]], None],
    out: Planes,
) -> None:
    """Moments of samples weighted by their `share`.

    Parameters
    ----------
    share, hidden : (...) float64
    features : (6, ...) float64
    add
        Writes sums of samples, its first argument, into the second.
    out : (36, ...) float64
        Gets the moments.
    """
    weighted = share * hidden
    add(share, out[COUNT])
    add(weighted, out[HIDDEN])
    add(weighted * hidden, out[SQUARE])
    for i, feature in enumerate(features):
        own = share * feature
        add(own, out[FEATURE + i])
        add(weighted * feature, out[HIDDEN_FEATURE + i])
        for j in range(i + 1):
            add(own * features[j], out[PAIR + PAIRS.index((i, j))])


class Polynomials(Record):
    """First-order polynomials of the hidden share, each fitted to a sum of moments."""

    count: NDArray[np.float64]  # (...) samples
    means: Planes  # (6, ...) of the features
    hidden: NDArray[np.float64]  # (...) mean hidden share
    slopes: Sequence[NDArray[np.float64]]  # six of (...)
    square: NDArray[np.float64]  # (...) sum of the squared residuals
    lower: Triangle  # covariance of the features = L D L^T
    inverse: Sequence[NDArray[np.float64]]  # six of (...): 1 / D

    def coefficients(self) -> Planes:
        """(7, ...) constant and slopes."""
        moved = sum(slope * mean for slope, mean in zip(self.slopes, self.means, strict=True))
        return np.stack([self.hidden - moved, *self.slopes])

    def at(self, features: Planes) -> NDArray[np.float64]:
        """(...) hidden share where the features are (6, ...)."""
        steps = zip(self.slopes, features - self.means, strict=True)
        return self.hidden + sum(slope * step for slope, step in steps)

    def leverage(self, features: Planes) -> NDArray[np.float64]:
        """(...) variance of the value there per variance of a sample."""
        steps = _substituted(self.lower, list(features - self.means))
        square = sum(step * step * scale for step, scale in zip(steps, self.inverse, strict=True))
        return (1 + square) / self.count

    def of_another(
        self, mean: NDArray[np.float64], products: Planes, features: Planes
    ) -> NDArray[np.float64]:
        """(...) where the features are (6, ...), the polynomial fitted to another quantity of the samples.

        Parameters
        ----------
        mean : (...) float64
            Of the quantity.
        products : (6, ...) float64
            Means of its products with the features.
        """
        forth = _substituted(self.lower, list(products - self.means * mean))
        slopes = [value * scale for value, scale in zip(forth, self.inverse, strict=True)]
        _substitute_back(self.lower, slopes)
        steps = zip(slopes, features - self.means, strict=True)
        return mean + sum(slope * step for slope, step in steps)


def polynomials(sums: Planes) -> Polynomials:
    """The polynomial of least squares of each sum of moments, (36, ...), which are overwritten."""
    count = np.maximum(sums[COUNT], 1e-30)
    sums /= count
    means, hidden = sums[FEATURE:PAIR], sums[HIDDEN]

    # Covariances of the features, with a ridge, and with the hidden share.
    covariance = {(i, j): sums[PAIR + number] - means[i] * means[j] for number, (i, j) in enumerate(PAIRS)}
    ridge = POSITION_RIDGE * (covariance[3, 3] + covariance[4, 4] + covariance[5, 5]) + ROUNDING
    for i in range(FEATURES):
        covariance[i, i] += NORMAL_RIDGE if i < 3 else ridge
    right = [sums[HIDDEN_FEATURE + i] - means[i] * hidden for i in range(FEATURES)]

    # Covariance = L D L^T; the slopes by substitution, forth and back.
    lower: Triangle = {}
    inverse: list[NDArray[np.float64]] = []
    for j in range(FEATURES):
        scaled = [lower[j, k] / inverse[k] for k in range(j)]
        pivot = covariance[j, j]
        for k in range(j):
            pivot = pivot - lower[j, k] * scaled[k]
        inverse.append(1 / np.maximum(pivot, ROUNDING))
        for i in range(j + 1, FEATURES):
            value = covariance[i, j]
            for k in range(j):
                value = value - lower[i, k] * scaled[k]
            lower[i, j] = value * inverse[j]
    forth = _substituted(lower, right)
    slopes = [forth[i] * inverse[i] for i in range(FEATURES)]
    explained = sum(forth[i] * slopes[i] for i in range(FEATURES))
    _substitute_back(lower, slopes)
    square = np.maximum(sums[SQUARE] - hidden * hidden - explained, 0) * count
    return Polynomials(count, means, hidden, slopes, square, lower, inverse)


def _substituted(lower: Triangle, right: list[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """L^-1 right."""
    out = list(right)
    for i in range(FEATURES):
        for k in range(i):
            out[i] = out[i] - lower[i, k] * out[k]
    return out


def _substitute_back(lower: Triangle, right: list[NDArray[np.float64]]) -> None:
    """L^-T right, in place."""
    for i in reversed(range(FEATURES)):
        for k in range(i + 1, FEATURES):
            right[i] = right[i] - lower[k, i] * right[k]
