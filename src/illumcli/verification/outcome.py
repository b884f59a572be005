"""The outcome of a case, and of all cases of a type."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.records import Record, Value
from illumcli.verification.vectors import Case

STANDARD_ERRORS = 4.5
"""An estimate further off than this many of its own standard errors fails; one in 150 000 does by chance."""


class Estimate(Value):
    """A Monte Carlo value and its own standard error."""

    value: float
    standard_error: float


Result: TypeAlias = NDArray[Any] | Estimate
"""What an evaluator returns: values of any shape, in the order of what is expected."""


class Outcome(Record):
    """A case's error, and the largest error that passes, in the same unit."""

    case: Case
    error: float
    """Largest deviation over the largest expected value, or standard errors; inf where it is not finite."""
    allowed: float
    statistical: bool = False
    """Errors are counted in standard errors."""

    @property
    def passed(self) -> bool:
        return self.error <= self.allowed


class TypeResult(Record):
    """The outcomes of one case type."""

    type: str
    outcomes: Sequence[Outcome]

    @property
    def worst(self) -> Outcome:
        """The outcome of the largest error; among equals the first."""
        return max(self.outcomes, key=lambda outcome: outcome.error)

    @property
    def used(self) -> float:
        """The largest share of its own tolerance that a case needs; above 1 it fails."""
        return float(max(_share(outcome.error, outcome.allowed) for outcome in self.outcomes))

    @property
    def failed(self) -> list[str]:
        """Ids of the cases beyond their tolerance."""
        return [outcome.case.id for outcome in self.outcomes if not outcome.passed]


def _share(error: float, allowed: float) -> float:
    """Of the tolerance that an error needs; inf where nothing but 0 passes."""
    if allowed:
        return error / allowed
    return 0.0 if error == 0 else float("inf")


def judge(case: Case, result: Result) -> Outcome:
    """The error of a result and what the case allows."""
    if isinstance(result, Estimate):
        error = deviation(case, np.array([result.value]))
        return Outcome(case, error / result.standard_error, STANDARD_ERRORS, statistical=True)
    return Outcome(case, deviation(case, result) / case.scale, case.allowed / case.scale)


def deviation(case: Case, result: NDArray[Any]) -> float:
    """max |x_i - e_i|; inf where the result is not finite or has another number of values."""
    values = np.asarray(result, np.float64).ravel()
    if values.shape != case.expected.shape or not np.isfinite(values).all():
        return float("inf")
    return float(np.abs(values - case.expected).max())
