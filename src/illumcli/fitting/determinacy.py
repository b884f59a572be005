"""Which combinations of parameters change the residuals, and which do not: the singular values of J."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.fitting.problem import Doubles, Problem
from illumcli.records import Record

NONE = 1e-7
"""A combination of parameters that changes the residuals less, beside the one that changes them most, is not
determined: that is what the differences of the derivatives resolve."""
PART = 0.05
"""A parameter takes part in a combination if its own effect is larger, beside the largest of the others."""


class Directions(Record):
    """The singular vectors of the derivatives by F coordinates, in units in which 1 is a large change."""

    J: Doubles
    """(3 N, F) derivatives of the residuals."""
    unit: Doubles
    """(F,) of each coordinate."""
    values: Doubles
    """(F,) singular values."""
    axes: Doubles
    """(F, F) unit vectors, a row for each singular value."""
    is_null: NDArray[np.bool_]
    """(F,) True for combinations that are not determined."""

    def members(self, axis: Doubles) -> NDArray[np.bool_]:
        """(F,) which coordinates take part in a combination."""
        effect = np.abs(axis) * np.maximum(np.linalg.norm(self.J, axis=0), NONE * self.values.max())
        return effect > PART * effect.max()

    def undetermined(self) -> NDArray[np.bool_]:
        """(F,) coordinates that take part in a combination that is not determined."""
        return np.any([self.members(axis) for axis in self.axes[self.is_null]] or [self.unit < 0], axis=0)


def directions_of(problem: Problem, x: Doubles, free: NDArray[np.intp]) -> Directions:
    """The singular vectors at coordinates `x`, of which those of numbers `free` are free."""
    unit = _units(problem, x)[free]
    J = problem.jacobian(x)[:, free] * unit
    # with fewer residuals than coordinates, rows of zeros give the axes that no residual changes with
    padded = np.pad(J, ((0, max(J.shape[1] - len(J), 0)), (0, 0)))
    _, values, axes = np.linalg.svd(padded, full_matrices=False)
    return Directions(J, unit, values, axes, values <= NONE * values.max(initial=0.0))


def _units(problem: Problem, x: Doubles) -> Doubles:
    """(P,) a large change of each coordinate: its range, its size where it has none, a factor of e."""
    out = np.ones_like(x)
    for each, place in problem.parameters.slices():
        if each.scale == "linear":
            reach = each.high - each.low
            out[place] = reach if reach <= 1e3 else max(float(np.abs(x[place]).max()), 1e-3)
    return out
