"""Messages of a page: how they are read, and which ones take the place of earlier ones."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias

from illumcli.viewer.cameras import MOTIONS

Message: TypeAlias = Mapping[str, Any]

MISUNDERSTOOD = (LookupError, TypeError, ValueError, ArithmeticError, AttributeError, RecursionError)
"""What a message raises that lacks something, or has something of another type, size or depth."""


def message_of(text: str | bytes) -> Message:
    """The message of a text; one of an unknown type if it is none."""
    try:
        message = json.loads(text)
    except (ValueError, RecursionError):
        message = None
    return message if isinstance(message, dict) else {"type": "unknown"}


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
        for motion in MOTIONS:
            if motion in first and motion in second:
                total = _sum(first[motion], second[motion])
                return None if total is None else {**second, motion: total}
    return None


def _sum(first: Any, second: Any) -> Any:
    """The sum of two motions; None if one of them is no motion."""
    try:
        if isinstance(first, list) and isinstance(second, list):
            return [a + b for a, b in zip(first, second, strict=True)]
        return first + second
    except MISUNDERSTOOD:
        return None
