"""Verification: compares the renderer's formulas with reference vectors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from illumcli.errors import InputError, ThresholdError
from illumcli.schema.families import tags
from illumcli.verification import (
    albedo,
    lobes,
    measured,
    microfacet,
    normals,
    obscurance,
    phong,
    radiometry,
    scanline,
)
from illumcli.verification.inputs import Inputs
from illumcli.verification.outcome import Result, TypeResult, judge
from illumcli.verification.report import as_data, as_table, single_data, single_table
from illumcli.verification.single import SingleResult, single_result
from illumcli.verification.vectors import PACKAGED, Case, read_cases, shorten

__all__ = [
    "EVALUATORS",
    "PACKAGED",
    "as_data",
    "as_table",
    "refuse_failures",
    "single_data",
    "single_table",
    "verify",
    "verify_single",
]

EVALUATORS: dict[str, Callable[[Inputs], Result]] = {
    **radiometry.CASES,
    **albedo.CASES,
    **phong.CASES,
    **normals.CASES,
    **scanline.CASES,
    **microfacet.CASES,
    **lobes.CASES,
    **measured.CASES,
    **obscurance.CASES,
}
"""Case type -> function from inputs to values, or to a Monte Carlo estimate."""


def known_types() -> set[str]:
    """Types that a case may have: those with an evaluator; models, for cases with `parameters`."""
    return {*EVALUATORS, *tags("illumcli.models")}


def verify(file: Path = PACKAGED, only: Sequence[str] = ()) -> list[TypeResult]:
    """Compare the cases of a vectors file, in float64, with their expected values; by type, in file order.

    Parameters
    ----------
    file : Path
        By default the vectors of the package.
    only : sequence of str
        Case types to verify; by default all.

    Raises
    ------
    InputError
        The file is malformed, or has an unknown case type or inputs that a formula does not accept.
    """
    groups = _by_type(read_cases(file, known_types(), only))
    return [
        TypeResult(name, [judge(case, evaluate(file, case)) for case in cases])
        for name, cases in groups.items()
    ]


def refuse_failures(results: Sequence[TypeResult]) -> None:
    """Raise ThresholdError if a case is beyond its tolerance."""
    failed = [name for result in results for name in result.failed]
    if failed:
        raise ThresholdError(f"beyond their tolerance: {shorten(failed, 10)}")


def verify_single(file: Path = PACKAGED, only: Sequence[str] = ()) -> list[SingleResult]:
    """The same in float32: the error of each type, and its cause.

    Types that cast rays are left out, because rays are always float32.
    """
    groups = _by_type(read_cases(file, known_types(), only))
    evaluate_case = partial(evaluate, file)
    return [
        single_result(name, cases, evaluate_case)
        for name, cases in groups.items()
        if name not in obscurance.CAST
    ]


def evaluate(
    file: Path, case: Case, dtype: DTypeLike = np.float64, rounded: frozenset[str] = frozenset()
) -> Result:
    """The renderer's result for a case, in a precision; the inputs `rounded` pass through float32 first."""
    place = f"{file}: {case.id}"
    inputs = Inputs(place, case.id, case.inputs, dtype, rounded)
    try:
        with np.errstate(all="ignore"):  # values that are not finite give an error of inf
            if "parameters" in case.inputs:
                return lobes.response_of_case(case.type, inputs)
            return EVALUATORS[case.type](inputs)
    except ValueError as error:  # a parameter out of its range
        raise InputError([f"{place}: {fact}" for fact in _facts(error)]) from error


def _facts(error: ValueError) -> list[str]:
    """One line per problem; the errors of a description have several, with their places."""
    details: list[Any] = getattr(error, "errors", list)()
    return [f"{'.'.join(map(str, each['loc']))}: {each['msg']}" for each in details] or [str(error)]


def _by_type(cases: Sequence[Case]) -> dict[str, list[Case]]:
    groups: dict[str, list[Case]] = {}
    for case in cases:
        groups.setdefault(case.type, []).append(case)
    return groups
