"""Where single precision loses digits, and why: the renderer's formulas in float32 against the reference."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import DTypeLike

from illumcli.records import Record
from illumcli.verification.outcome import Outcome, Result, judge
from illumcli.verification.vectors import Case

FINE = 1e-5
"""Relative error that float32 keeps where nothing cancels."""
DIRECTIONS = ("l", "v", "h", "t")
"""Inputs that are shown by their cosine to the normal."""

Evaluate: TypeAlias = Callable[[Case, DTypeLike, frozenset[str]], Result]
"""From a case and the fields `dtype` and `rounded` of `Inputs`."""


class Loss(Record):
    """A case that float32 gets wrong by more than `FINE`."""

    outcome: Outcome
    cause: str
    """`inputs` where rounding them explains it, `range` where float32 has no such number, or `arithmetic`."""
    reason: str
    inputs: str
    """The case's inputs, in short."""


class SingleResult(Record):
    """One case type in float32."""

    type: str
    outcomes: Sequence[Outcome]
    losses: Sequence[Loss]

    @property
    def worst(self) -> Outcome:
        return max(self.outcomes, key=lambda outcome: outcome.error)


def single_result(type_: str, cases: Sequence[Case], evaluate: Evaluate) -> SingleResult:
    """The cases of one type in float32; those that lost digits with the reason."""
    outcomes = [_outcome(case, evaluate, dtype=np.float32) for case in cases]
    return SingleResult(type_, outcomes, [_loss(o, evaluate) for o in outcomes if o.error > FINE])


def _outcome(
    case: Case, evaluate: Evaluate, dtype: DTypeLike = np.float64, rounded: frozenset[str] = frozenset()
) -> Outcome:
    return judge(case, evaluate(case, dtype, rounded))


def _loss(outcome: Outcome, evaluate: Evaluate) -> Loss:
    """Why a case lost digits, found by rounding its inputs to float32 in float64 code."""
    case, limits = outcome.case, np.finfo(np.float32)
    short = shortened(case.inputs)
    if not limits.tiny <= case.scale <= limits.max:
        return Loss(outcome, "range", f"{case.scale:.1e} is outside float32's range", short)

    # Less than half of the error comes from rounding the inputs: it is the arithmetic.
    by_inputs = _outcome(case, evaluate, rounded=frozenset(case.inputs)).error
    if by_inputs < outcome.error / 2:
        return Loss(outcome, "arithmetic", f"arithmetic; rounding the inputs makes {by_inputs:.1e}", short)

    # Otherwise name the input whose rounding alone does most.
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
