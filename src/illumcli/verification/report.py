"""Verification results as tables, and as data for JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from illumcli.tables import table
from illumcli.verification.claims import ClaimResult
from illumcli.verification.outcome import STANDARD_ERRORS, Outcome, TypeResult
from illumcli.verification.single import FINE, SingleResult

MEANINGS = {
    "light": "negative or not finite",
    "reciprocal": "changes if light and eye change places",
    "isotropic": "changes if the surface is turned",
    "conserving": "reflects more light than arrives",
}
"""What it says of a model that a claim does not hold."""


def as_table(results: Sequence[TypeResult]) -> str:
    """One line per case type, and a summary."""
    lines = [("type", "cases", "worst error", "in case", "tolerance", "used", "verdict")]
    for result in results:
        worst = result.worst
        verdict = f"{len(result.failed)} beyond" if result.failed else "ok"
        numbers = (
            _error(worst, worst.error),
            worst.case.id,
            _error(worst, worst.allowed),
            f"{result.used:.2g}",
        )
        lines.append((result.type, str(len(result.outcomes)), *numbers, verdict))
    return f"{table(lines, right=(1, 2, 4, 5))}\n\n{summary(results)}"


def claims_table(results: Sequence[ClaimResult]) -> str:
    """One line per claim, those that do not hold with the place, and a summary."""
    lines = [("claims of", "claim", "parameters", "worst", "tolerance", "verdict")]
    for each in results:
        worst, allowed = f"{each.worst:.1e}", f"{each.allowed:.0e}"
        if each.claim == "conserving":
            worst, allowed = f"{1 + each.worst:.4f}", f"{1 + each.allowed:.4f}"
        verdict = "ok" if each.passed else "does not hold"
        if each.worst == -float("inf"):
            worst, verdict = "", "lobes too narrow to tell"
        lines.append((each.name, each.claim, str(each.checked), worst, allowed, verdict))
    failed = [each for each in results if not each.passed]
    places = [f"{each.name}: {MEANINGS[each.claim]}: {each.where}" for each in failed]
    held = f"{len(failed)} do not hold" if failed else "all hold"
    text = table(lines, right=(2, 3, 4))
    return "\n\n".join([text, *(["\n".join(places)] if places else []), f"{len(results)} claims: {held}"])


def summary(results: Sequence[TypeResult]) -> str:
    """Number of verified cases, and of those beyond their tolerance."""
    count = sum(len(result.outcomes) for result in results)
    statistical = sum(outcome.statistical for result in results for outcome in result.outcomes)
    failed = sum(len(result.failed) for result in results)
    verdict = f"{failed} beyond their tolerance" if failed else "all within their tolerance"
    text = f"{_counted(count, 'case')} of {_counted(len(results), 'type')}: {verdict}"
    if statistical:
        text += f"; {statistical} by Monte Carlo, within {STANDARD_ERRORS} of its own standard errors (se)"
    return text


def as_data(results: Sequence[TypeResult], claims: Sequence[ClaimResult] = ()) -> dict[str, Any]:
    """The results for JSON."""
    return {
        "precision": "double",
        "claims": [
            {
                "name": each.name,
                "claim": each.claim,
                "parameters": each.checked,
                "worst": _finite(abs(each.worst)) and each.worst,
                "tolerance": each.allowed,
                "holds": each.passed,
                "where": each.where,
            }
            for each in claims
        ],
        "types": [
            {
                "type": result.type,
                "cases": len(result.outcomes),
                "worst_error": _finite(result.worst.error),
                "worst_case": result.worst.case.id,
                "tolerance": result.worst.allowed,
                "unit": "standard errors" if result.worst.statistical else "relative",
                "used": _finite(result.used),
                "failed": result.failed,
            }
            for result in results
        ],
        "cases": sum(len(result.outcomes) for result in results),
        "failed": sum(len(result.failed) for result in results),
    }


def single_table(results: Sequence[SingleResult]) -> str:
    """Worst float32 errors by type; then, for each type that loses digits, its worst case and the cause."""
    lines = [("type", "cases", "worst error", "in case", f"above {FINE:.0e}")]
    lines += [
        (
            result.type,
            str(len(result.outcomes)),
            f"{result.worst.error:.1e}",
            result.worst.case.id,
            str(len(result.losses)),
        )
        for result in results
    ]
    text = table(lines, right=(1, 2, 4))
    lost = [("digits lost in", "error", "reason", "inputs")]
    for result in results:
        if result.losses:
            loss = max(result.losses, key=lambda each: each.outcome.error)
            lost.append((loss.outcome.case.id, f"{loss.outcome.error:.1e}", loss.reason, loss.inputs))
    if len(lost) > 1:
        text += "\n\n" + table(lost, right=(1,))
    return f"{text}\n\n{single_summary(results)}"


def single_summary(results: Sequence[SingleResult]) -> str:
    """Number of cases that lost digits, by cause."""
    count = sum(len(result.outcomes) for result in results)
    causes = Counter(loss.cause for result in results for loss in result.losses)
    return (
        f"{_counted(count, 'case')} of {_counted(len(results), 'type')} in float32: "
        f"{causes.total()} above {FINE:.0e}; "
        f"{causes['inputs']} because rounding the inputs alone does it, "
        f"{causes['range']} outside float32's range, "
        f"{causes['arithmetic']} in the arithmetic"
    )


def single_data(results: Sequence[SingleResult]) -> dict[str, Any]:
    """The results for JSON, with every case that lost digits."""
    return {
        "precision": "single",
        "types": [
            {
                "type": result.type,
                "cases": len(result.outcomes),
                "worst_error": _finite(result.worst.error),
                "worst_case": result.worst.case.id,
                "lost": [
                    {
                        "case": loss.outcome.case.id,
                        "error": _finite(loss.outcome.error),
                        "cause": loss.cause,
                        "reason": loss.reason,
                        "inputs": loss.inputs,
                    }
                    for loss in result.losses
                ],
            }
            for result in results
        ],
        "cases": sum(len(result.outcomes) for result in results),
    }


def _error(outcome: Outcome, value: float) -> str:
    return f"{value:.2f} se" if outcome.statistical else f"{value:.1e}"


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"


def _finite(value: float) -> float | None:
    return value if value < float("inf") else None
