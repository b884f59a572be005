"""The outcome of a case, and of all cases of a type."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.records import Record, Value
from illumcli.verification.vectors import Case

STANDARD_ERRORS = 4.5
"""An estimate with an error above this many of its standard errors fails; by chance one in 150 000 does."""


class Estimate(Value):
    """A Monte Carlo value and its standard error."""

    value: float
    standard_error: float


Result: TypeAlias = NDArray[Any] | Estimate
"""The result of an evaluator: values of any shape, in the order of the expected values, or an estimate."""


class Outcome(Record):
    """A case's error and the largest error that passes, in the same unit."""

    case: Case
    error: float
    """Largest deviation relative to the largest expected value, or in standard errors; inf if not finite."""
    allowed: float
    statistical: bool = False
    """True if the error is in standard errors."""

    @property
    def passed(self) -> bool:
        return self.error <= self.allowed


class TypeResult(Record):
    """The outcomes of one case type."""

    type: str
    outcomes: Sequence[Outcome]

    @property
    def worst(self) -> Outcome:
        """The outcome with the largest error, the first among equals."""
        return max(self.outcomes, key=lambda outcome: outcome.error)

    @property
    def used(self) -> float:
        """The largest error of a case relative to its tolerance; above 1 the case fails."""
        return float(max(_share(outcome.error, outcome.allowed) for outcome in self.outcomes))

    @property
    def failed(self) -> list[str]:
        """Ids of the cases beyond their tolerance."""
        return [outcome.case.id for outcome in self.outcomes if not outcome.passed]


def _share(error: float, allowed: float) -> float:
    """The error relative to the tolerance; inf if only 0 passes."""
    if allowed:
        return error / allowed
    return 0.0 if error == 0 else float("inf")


def judge(case: Case, result: Result) -> Outcome:
    """The error of a result, and the largest that the case allows."""
    if isinstance(result, Estimate):
        error = deviation(case, np.array([result.value]))
        return Outcome(case, error / result.standard_error, STANDARD_ERRORS, statistical=True)
    return Outcome(case, deviation(case, result) / case.scale, case.allowed / case.scale)


def deviation(case: Case, result: NDArray[Any]) -> float:
    """max |x_i - e_i|; inf if the result is not finite or has another number of values."""
    values = np.asarray(result, np.float64).ravel()
    if values.shape != case.expected.shape or not np.isfinite(values).all():
        return float("inf")
    return float(np.abs(values - case.expected).max())
