"""Verification: compares the renderer's formulas with reference vectors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike

from illumcli.errors import InputError, ThresholdError
from illumcli.models._base import IlluminationModel
from illumcli.scene.access import resolve
from illumcli.scene.load import load
from illumcli.schema.families import member, members, tag_of
from illumcli.schema.messages import suggestion
from illumcli.schema.sources import has_member, tags
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
from illumcli.verification.claims import ClaimResult, claims_of
from illumcli.verification.inputs import Inputs
from illumcli.verification.outcome import Result, TypeResult, judge
from illumcli.verification.report import as_data, as_table, claims_table, single_data, single_table
from illumcli.verification.single import SingleResult, single_result
from illumcli.verification.vectors import PACKAGED, Case, read_cases, shorten

__all__ = [
    "EVALUATORS",
    "PACKAGED",
    "as_data",
    "as_table",
    "claims_table",
    "refuse_failures",
    "single_data",
    "single_table",
    "verify",
    "verify_claims",
    "verify_materials",
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
        Case types to verify; by default all. Models without cases in the vectors of the package are ignored.

    Raises
    ------
    InputError
        The file is malformed, or has an unknown case type or inputs that a formula does not accept.
    """
    may_lack = tags("illumcli.models") if file == PACKAGED else ()
    groups = _by_type(read_cases(file, known_types(), only, may_lack))
    return [
        TypeResult(name, [judge(case, evaluate(file, case)) for case in cases])
        for name, cases in groups.items()
    ]


def verify_claims(only: Sequence[str] = ()) -> list[ClaimResult]:
    """The claims of illumination models, with random parameters; models that need a file or a formula are
    checked in a scene.

    Parameters
    ----------
    only : sequence of str
        Tags of models; other words are ignored. By default all.
    """
    models = "illumcli.models"
    chosen = [member(models, tag) for tag in only if has_member(models, tag)] if only else members(models)
    whole = [Model for Model in chosen if not any(each.is_required() for each in Model.model_fields.values())]
    return [result for Model in whole for result in claims_of(tag_of(Model), Model(), is_fixed=False)]


def verify_materials(scene: Path, only: Sequence[str] = ()) -> list[ClaimResult]:
    """The claims of the materials of a scene, with their parameters.

    Raises
    ------
    InputError
        The scene has faults, or no material of such a name.
    """
    loaded = load(scene)
    materials: dict[str, IlluminationModel] = dict(loaded.scene.materials)
    for name, thing in zip(loaded.scene.object_names(), loaded.scene.objects, strict=True):
        own = loaded.scene.material_of(thing)
        if own is not None and (thing.override or not isinstance(thing.material, str)):
            materials[name] = own
    if problems := [
        f"--only {name}: {scene} has no such material; {suggestion(name, tuple(materials))}"
        for name in only
        if name not in materials
    ]:
        raise InputError(problems)
    results = []
    for name in only or materials:
        model = materials[name]
        if hasattr(model, "file"):
            model = model.at({"file": str(resolve(loaded, model.file))})
        results += claims_of(name, model, is_fixed=True)
    return results


def refuse_failures(results: Sequence[TypeResult], claims: Sequence[ClaimResult] = ()) -> None:
    """Raise ThresholdError if a case is beyond its tolerance, or a claim does not hold."""
    failed = [name for result in results for name in result.failed]
    failed += [f"{each.name} {each.claim}" for each in claims if not each.passed]
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
