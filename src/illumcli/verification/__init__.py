"""Checks the renderer's own formulas against reference vectors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from illumcli.errors import InputError, ThresholdError
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
from illumcli.verification.outcome import Row, judge
from illumcli.verification.report import as_data, as_table, single_data, single_table
from illumcli.verification.single import SingleRow, single_row
from illumcli.verification.vectors import PACKAGED, Case, read_cases, shorten

__all__ = [
    "EVALUATORS",
    "PACKAGED",
    "as_data",
    "as_table",
    "check",
    "run",
    "run_single",
    "single_data",
    "single_table",
]

EVALUATORS: dict[str, Callable[[Inputs], Any]] = {
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
"""Case type -> inputs to values, or to an Estimate."""


def run(file: Path = PACKAGED, only: Sequence[str] = ()) -> list[Row]:
    """Every case of a vectors file in float64 beside what is expected, one row per type in the file's order.

    Parameters
    ----------
    file : Path
        By default the vectors that come with the package.
    only : sequence of str
        Case types to look at; by default all.

    Raises
    ------
    InputError
        The file is malformed, holds an unknown case type or inputs that a formula does not take.
    """
    groups = _by_type(read_cases(file, EVALUATORS, only))
    return [
        Row(name, [judge(case, evaluate(file, case)) for case in cases]) for name, cases in groups.items()
    ]


def check(rows: Sequence[Row]) -> None:
    """Raise ThresholdError where a case is beyond its tolerance."""
    failed = [name for row in rows for name in row.failed]
    if failed:
        raise ThresholdError(f"beyond their tolerance: {shorten(failed, 10)}")


def run_single(file: Path = PACKAGED, only: Sequence[str] = ()) -> list[SingleRow]:
    """The same in float32: how far each type is off, and why. Types that cast rays, which are
    always float32, are left out."""
    groups = _by_type(read_cases(file, EVALUATORS, only))
    there = partial(evaluate, file)
    return [single_row(name, cases, there) for name, cases in groups.items() if name not in obscurance.CAST]


def evaluate(file: Path, case: Case, **precision: Any) -> Any:
    """What the renderer makes of a case; `precision` sets fields of `Inputs`."""
    place = f"{file}: {case.id}"
    inputs = Inputs(place, case.id, case.inputs, **precision)
    try:
        with np.errstate(all="ignore"):  # what is not finite shows as an error of inf
            return EVALUATORS[case.type](inputs)
    except ValueError as error:  # a parameter out of its range
        raise InputError([f"{place}: {fact}" for fact in _facts(error)]) from error


def _facts(error: ValueError) -> list[str]:
    """One line per problem; a description that is refused lists them with their places."""
    details: list[Any] = getattr(error, "errors", list)()
    return [f"{'.'.join(map(str, each['loc']))}: {each['msg']}" for each in details] or [str(error)]


def _by_type(cases: Sequence[Case]) -> dict[str, list[Case]]:
    groups: dict[str, list[Case]] = {}
    for case in cases:
        groups.setdefault(case.type, []).append(case)
    return groups
