"""What came out of a case, and how a case type did as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

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


class Outcome(Record):
    """A case's error, and the largest that passes, in the same unit."""

    case: Case
    error: float
    """Largest deviation over the largest expected value, or standard errors; inf where it is not finite."""
    allowed: float
    statistical: bool = False
    """Errors are counted in standard errors."""

    @property
    def passed(self) -> bool:
        return self.error <= self.allowed


class Row(Record):
    """One case type: its outcomes, summed up."""

    type: str
    outcomes: Sequence[Outcome]

    @property
    def worst(self) -> Outcome:
        """The outcome of the largest error; among equals the first."""
        return max(self.outcomes, key=lambda outcome: outcome.error)

    @property
    def used(self) -> float:
        """The largest share of its own tolerance that a case needs; above 1 it fails."""
        shares = [
            o.error / o.allowed if o.allowed else (0.0 if o.error == 0 else np.inf) for o in self.outcomes
        ]
        return float(max(shares))

    @property
    def failed(self) -> list[str]:
        """Ids of the cases beyond their tolerance."""
        return [outcome.case.id for outcome in self.outcomes if not outcome.passed]


def judge(case: Case, result: Any) -> Outcome:
    """A result beside what was expected."""
    if isinstance(result, Estimate):
        away = deviation(case, np.array([result.value]))
        return Outcome(case, away / result.standard_error, STANDARD_ERRORS, statistical=True)
    return Outcome(case, deviation(case, result) / case.scale, case.allowed / case.scale)


def deviation(case: Case, result: NDArray[Any]) -> float:
    """max |x_i - e_i|; inf where the result is not finite or has another number of values."""
    values = np.asarray(result, np.float64).ravel()
    if values.shape != case.expected.shape or not np.isfinite(values).all():
        return float("inf")
    return float(np.abs(values - case.expected).max())
