"""Errors of single precision and their causes: the renderer's formulas in float32 against the reference."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import DTypeLike

from illumcli.records import Record
from illumcli.verification.outcome import Outcome, Result, judge
from illumcli.verification.vectors import Case

FINE = 1e-5
"""Relative error of float32 without cancellation."""
DIRECTIONS = ("l", "v", "h", "t")
"""Inputs that are printed as their cosine to the normal."""

Evaluate: TypeAlias = Callable[[Case, DTypeLike, frozenset[str]], Result]
"""The result of a case, for fields `dtype` and `rounded` of `Inputs`."""


class Loss(Record):
    """A case with a float32 error above `FINE`."""

    outcome: Outcome
    cause: str
    """`inputs` if their rounding explains the error, `range` if float32 cannot represent them, or
    `arithmetic`."""
    reason: str
    inputs: str
    """The case's inputs, abbreviated."""


class SingleResult(Record):
    """One case type in float32."""

    type: str
    outcomes: Sequence[Outcome]
    losses: Sequence[Loss]

    @property
    def worst(self) -> Outcome:
        return max(self.outcomes, key=lambda outcome: outcome.error)


def single_result(type_: str, cases: Sequence[Case], evaluate: Evaluate) -> SingleResult:
    """The cases of one type in float32, with the cause for those that lost digits."""
    outcomes = [_outcome(case, evaluate, dtype=np.float32) for case in cases]
    return SingleResult(type_, outcomes, [_loss(o, evaluate) for o in outcomes if o.error > FINE])


def _outcome(
    case: Case, evaluate: Evaluate, dtype: DTypeLike = np.float64, rounded: frozenset[str] = frozenset()
) -> Outcome:
    return judge(case, evaluate(case, dtype, rounded))


def _loss(outcome: Outcome, evaluate: Evaluate) -> Loss:
    """The cause of a case's error, by running float64 code with inputs rounded to float32."""
    case, limits = outcome.case, np.finfo(np.float32)
    short = shortened(case.inputs)
    if not limits.tiny <= case.scale <= limits.max:
        return Loss(outcome, "range", f"{case.scale:.1e} is outside float32's range", short)

    # If rounding all inputs causes less than half of the error, the cause is arithmetic.
    by_inputs = _outcome(case, evaluate, rounded=frozenset(case.inputs)).error
    if by_inputs < outcome.error / 2:
        return Loss(outcome, "arithmetic", f"arithmetic; rounding the inputs makes {by_inputs:.1e}", short)

    # Otherwise it is the input whose rounding alone has the largest effect.
    by_input = {
        key: _outcome(case, evaluate, rounded=frozenset([key])).error
        for key, value in case.inputs.items()
        if not isinstance(value, str | bool)
    }
    key = max(by_input, key=lambda name: by_input[name])
    return Loss(outcome, "inputs", f"rounding {key} alone makes {by_input[key]:.1e}", short)


def shortened(inputs: Mapping[str, Any]) -> str:
    """Scalars by name, directions by their cosine to the normal, nested parameters in parentheses."""
    parts = []
    for key, value in inputs.items():
        if isinstance(value, int | float) and not isinstance(value, bool):
            parts.append(f"{key}={value:.7g}")
        elif isinstance(value, str):
            parts.append(value)
        elif isinstance(value, dict):
            parts.append(f"{key}({shortened(value)})")
        elif key in DIRECTIONS and "n" in inputs:
            n, vector = np.array(inputs["n"], float), np.array(value, float)
            cosine = n @ vector / np.linalg.norm(n) / np.linalg.norm(vector)
            parts.append(f"n.{key}={cosine:.4g}")
    return " ".join(parts)
