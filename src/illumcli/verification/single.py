"""Where single precision loses digits, and why: the renderer's formulas in float32 beside the reference."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from illumcli.records import Record
from illumcli.verification.outcome import Outcome, judge
from illumcli.verification.vectors import Case

FINE = 1e-5
"""Relative error that float32 keeps where nothing cancels."""
DIRECTIONS = ("l", "v", "h", "t")

Evaluate = Callable[..., Any]
"""Case and precision to values."""


class Loss(Record):
    """A case that float32 gets wrong by more than `FINE`."""

    outcome: Outcome
    cause: str
    """`inputs` where rounding them explains it, `range` where float32 has no such number, or `arithmetic`."""
    reason: str
    inputs: str
    """What matters of the case's inputs, in short."""


class SingleRow(Record):
    """One case type in float32."""

    type: str
    outcomes: Sequence[Outcome]
    losses: Sequence[Loss]

    @property
    def worst(self) -> Outcome:
        return max(self.outcomes, key=lambda outcome: outcome.error)


def single_row(type_: str, cases: Sequence[Case], evaluate: Evaluate) -> SingleRow:
    """The cases of one type in float32; those that lost digits with their reason.

    Parameters
    ----------
    evaluate : function of a case and the fields `dtype` and `rounded` of `Inputs`
    """
    outcomes = [_outcome(case, evaluate, dtype=np.float32) for case in cases]
    return SingleRow(type_, outcomes, [_loss(o, evaluate) for o in outcomes if o.error > FINE])


def _outcome(case: Case, evaluate: Evaluate, **precision: Any) -> Outcome:
    return judge(case, evaluate(case, **precision))


def _loss(outcome: Outcome, evaluate: Evaluate) -> Loss:
    case, limits = outcome.case, np.finfo(np.float32)
    short = shortened(case.inputs)
    if not limits.tiny <= case.scale <= limits.max:
        return Loss(outcome, "range", f"{case.scale:.1e} is outside float32's range", short)

    def rounded(*keys: str) -> float:
        return _outcome(case, evaluate, rounded=frozenset(keys)).error

    by_inputs = rounded(*case.inputs)
    if by_inputs < outcome.error / 2:
        return Loss(outcome, "arithmetic", f"arithmetic; rounding the inputs makes {by_inputs:.1e}", short)
    alone = {key: rounded(key) for key, value in case.inputs.items() if not isinstance(value, str | bool)}
    key = max(alone, key=lambda name: alone[name])
    return Loss(outcome, "inputs", f"rounding {key} alone makes {alone[key]:.1e}", short)


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
            n, way = np.array(inputs["n"], float), np.array(value, float)
            parts.append(f"n.{key}={n @ way / np.linalg.norm(n) / np.linalg.norm(way):.4g}")
    return " ".join(parts)
