"""The works of a bounded number of units, held from planning until they are done."""

from __future__ import annotations

from collections.abc import Callable

from illumcli.commands.work import Work

HELD = 256
"""The works of so many units are held, some 80 kB each; those of others are prepared again when needed."""


class HeldWorks:
    """The works of units by number, each prepared when it is first asked for.

    Parameters
    ----------
    prepare : callable
        Returns the work of a unit.
    """

    def __init__(self, prepare: Callable[[int], Work]) -> None:
        self._prepare = prepare
        self._held: dict[int, Work] = {}

    def of(self, number: int) -> Work:
        """The work of a unit. It is held; if too many are, it takes the place of the one prepared last."""
        if number not in self._held:
            work = self._prepare(number)
            if len(self._held) >= HELD:
                self._held.popitem()
            self._held[number] = work
        return self._held[number]

    def drop(self, number: int) -> None:
        """Drop the work of a unit that is done."""
        self._held.pop(number, None)
