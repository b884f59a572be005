"""How far a whole batch is, from how far each of its pieces is."""

from __future__ import annotations

from collections.abc import Collection

from illumcli.commands.batch import Batch
from illumcli.progress import Progress

STEPS = 1000
"""Steps of the progress of one piece."""


class BatchProgress:
    """Tells of all pieces in one line: how many are finished and have failed, and how far the rest is.

    Pieces whose files exist count as finished, but not for the time that remains. A single piece tells of
    itself.

    Parameters
    ----------
    due : collection of int
        The pieces that are computed.
    """

    def __init__(self, batch: Batch, due: Collection[int], progress: Progress) -> None:
        self._batch, self._due, self._progress = batch, frozenset(due), progress
        self._finished = self._computed = 0

    def of_piece(self, what: str, done: int, total: int) -> None:
        """The progress of the piece at work, a `Progress`."""
        if self._batch.own_count == 1:
            self._progress(what, done, total)
        else:
            self._tell(min(done / max(total, 1), 1))

    def start(self) -> None:
        """Tell that nothing is computed yet."""
        if self._batch.own_count > 1:
            self._tell(0)

    def finished(self, number: int) -> None:
        """Tell that a piece is finished or has failed."""
        self._finished += 1
        self._computed += number in self._due
        if self._batch.own_count > 1:
            self._tell(0)

    def _tell(self, part: float) -> None:
        """`part` of the piece at work is done."""
        failed = len(self._batch.failures)
        what = f"{self._finished:,} of {self._batch.own_count:,} {self._batch.what}"
        text = f"{what}, {failed:,} failed" if failed else what
        self._progress(text, int((self._computed + part) * STEPS), len(self._due) * STEPS)
