"""Messages of a page: which ones take the place of earlier ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias

Message: TypeAlias = Mapping[str, Any]

MOVES = ("orbit", "pan", "dolly")


def coalesced(messages: Iterable[Message]) -> list[Message]:
    """Messages with the same effect: of values for one path the last, of moves of one kind the sum."""
    out: list[Message] = []
    for message in messages:
        joined = _joined(out[-1], message) if out else None
        if joined is None:
            out.append(message)
        else:
            out[-1] = joined
    return out


def _joined(first: Message, second: Message) -> Message | None:
    """One message instead of two that follow each other; None if both are needed."""
    kind = second.get("type")
    if first.get("type") != kind:
        return None
    if kind == "view":
        return {**first, **second}
    if kind == "set" and first.get("path") == second.get("path"):
        return second
    if kind == "move":
        for move in MOVES:
            if move in first and move in second:
                return {**second, move: _sum(first[move], second[move])}
    return None


def _sum(first: Any, second: Any) -> Any:
    if isinstance(first, list) and isinstance(second, list):
        return [a + b for a, b in zip(first, second, strict=True)]
    return first + second
