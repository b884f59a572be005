"""Prints verification as tables and as data for JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from illumcli.verification.outcome import STANDARD_ERRORS, Outcome, Row
from illumcli.verification.single import FINE, SingleRow


def as_table(rows: Sequence[Row]) -> str:
    """One line per case type, and a summary."""
    lines = [("type", "cases", "worst error", "in case", "tolerance", "used", "verdict")]
    for row in rows:
        worst = row.worst
        verdict = f"{len(row.failed)} beyond" if row.failed else "ok"
        numbers = (_error(worst, worst.error), worst.case.id, _error(worst, worst.allowed), f"{row.used:.2g}")
        lines.append((row.type, str(len(row.outcomes)), *numbers, verdict))
    return f"{_aligned(lines, left=(0, 3, 6))}\n\n{summary(rows)}"


def summary(rows: Sequence[Row]) -> str:
    """How many cases were looked at, and how many are beyond their tolerance."""
    count = sum(len(row.outcomes) for row in rows)
    statistical = sum(outcome.statistical for row in rows for outcome in row.outcomes)
    failed = sum(len(row.failed) for row in rows)
    verdict = f"{failed} beyond their tolerance" if failed else "all within their tolerance"
    told = f"{_counted(count, 'case')} of {_counted(len(rows), 'type')}: {verdict}"
    if statistical:
        told += f"; {statistical} by Monte Carlo, within {STANDARD_ERRORS} of its own standard errors (se)"
    return told


def as_data(rows: Sequence[Row]) -> dict[str, Any]:
    """The same for JSON."""
    return {
        "precision": "double",
        "types": [
            {
                "type": row.type,
                "cases": len(row.outcomes),
                "worst_error": _finite(row.worst.error),
                "worst_case": row.worst.case.id,
                "tolerance": row.worst.allowed,
                "unit": "standard errors" if row.worst.statistical else "relative",
                "used": _finite(row.used),
                "failed": row.failed,
            }
            for row in rows
        ],
        "cases": sum(len(row.outcomes) for row in rows),
        "failed": sum(len(row.failed) for row in rows),
    }


def single_table(rows: Sequence[SingleRow]) -> str:
    """Worst errors of float32 per type; then, for each type that loses digits, its worst case and why."""
    lines = [("type", "cases", "worst error", "in case", f"above {FINE:.0e}")]
    lines += [
        (row.type, str(len(row.outcomes)), f"{row.worst.error:.1e}", row.worst.case.id, str(len(row.losses)))
        for row in rows
    ]
    text = _aligned(lines, left=(0, 3))
    lost = [("digits lost in", "error", "reason", "inputs")]
    for row in rows:
        if row.losses:
            loss = max(row.losses, key=lambda each: each.outcome.error)
            lost.append((loss.outcome.case.id, f"{loss.outcome.error:.1e}", loss.reason, loss.inputs))
    if len(lost) > 1:
        text += "\n\n" + _aligned(lost, left=(0, 2, 3))
    return f"{text}\n\n{single_summary(rows)}"


def single_summary(rows: Sequence[SingleRow]) -> str:
    """How many cases lost digits, by cause."""
    count = sum(len(row.outcomes) for row in rows)
    causes = Counter(loss.cause for row in rows for loss in row.losses)
    return (
        f"{_counted(count, 'case')} of {_counted(len(rows), 'type')} in float32: "
        f"{causes.total()} above {FINE:.0e}; "
        f"{causes['inputs']} because rounding the inputs alone does it, "
        f"{causes['range']} outside float32's range, "
        f"{causes['arithmetic']} in the arithmetic"
    )


def single_data(rows: Sequence[SingleRow]) -> dict[str, Any]:
    """The same for JSON, with every case that lost digits."""
    return {
        "precision": "single",
        "types": [
            {
                "type": row.type,
                "cases": len(row.outcomes),
                "worst_error": _finite(row.worst.error),
                "worst_case": row.worst.case.id,
                "lost": [
                    {
                        "case": loss.outcome.case.id,
                        "error": _finite(loss.outcome.error),
                        "cause": loss.cause,
                        "reason": loss.reason,
                        "inputs": loss.inputs,
                    }
                    for loss in row.losses
                ],
            }
            for row in rows
        ],
        "cases": sum(len(row.outcomes) for row in rows),
    }


def _error(outcome: Outcome, value: float) -> str:
    return f"{value:.2f} se" if outcome.statistical else f"{value:.1e}"


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"


def _finite(value: float) -> float | None:
    return value if value < float("inf") else None


def _aligned(lines: Sequence[tuple[str, ...]], left: tuple[int, ...]) -> str:
    widths = [max(len(line[column]) for line in lines) for column in range(len(lines[0]))]
    return "\n".join(
        "  ".join(
            word.ljust(width) if column in left else word.rjust(width)
            for column, (word, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in lines
    )
