"""Progress of a long computation."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[str, int, int], None]
"""Called with the name of a computation, the amount done, and the total, several times with the same amount;
an exception that it raises ends the computation."""


def no_progress(what: str, done: int, total: int) -> None:
    """Show nothing."""
