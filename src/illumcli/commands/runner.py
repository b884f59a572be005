"""Who does the pieces of a batch: this process, or the workers of a cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from illumcli.commands.batch import Batch
from illumcli.commands.batch_progress import BatchProgress
from illumcli.commands.turns import turns
from illumcli.progress import Progress, no_progress
from illumcli.records import Value

if TYPE_CHECKING:
    from illumcli.baking.inputs import BakeWork
    from illumcli.commands.unit import Unit
    from illumcli.commands.work import Work

R = TypeVar("R")


class Cut(Protocol[R]):
    """Cuts large pieces of a batch into units for several workers."""

    def parts(self, due: Sequence[int], workers: int) -> Mapping[int, Sequence[Unit]]:
        """Number of a piece that is cut -> its units."""

    def join(self, number: int, results: Sequence[R]) -> R:
        """The result of a piece, from those of its units."""


class Pieces(Value, Generic[R]):
    """The pieces of a batch, by index."""

    unit: Callable[[int], Unit]
    """The unit of work of a piece."""
    claim_of: Callable[[int], Path | None]
    """The path of the claim on a piece; None for a piece that needs none."""
    run: Callable[[int, Progress], R]
    """Does a piece in this process, and tells how far it is."""
    kept: frozenset[int]
    """Those of which all files exist already: nothing is computed."""
    cut: Callable[[], Cut[R]] | None = None
    """How large pieces are shared among workers; by default they are not."""


class PlannedPieces:
    """The pieces of a batch as they are planned: which exist already, and the claims on the others."""

    def __init__(self) -> None:
        self._claims: dict[int, Path | None] = {}
        self._kept: set[int] = set()

    def add(self, number: int, work: Work | BakeWork) -> None:
        """Plan a piece.

        Raises
        ------
        OutputError
            A different file exists; a file cannot be written.
        LimitError
            Memory or disk cannot hold what is due.
        """
        if work.due():
            self._claims[number] = work.claim
        else:
            self._claims[number] = None
            self._kept.add(number)

    def pieces(
        self,
        unit: Callable[[int], Unit],
        run: Callable[[int, Progress], R],
        cut: Callable[[], Cut[R]] | None = None,
    ) -> Pieces[R]:
        """The pieces, each done by `run`."""
        return Pieces(unit, self._claims.__getitem__, run, frozenset(self._kept), cut)


class Runner(Protocol):
    """Does the pieces of a batch that have not failed."""

    def results(self, batch: Batch, pieces: Pieces[R]) -> Iterator[tuple[int, Callable[[], R]]]:
        """The index of each piece, and a function that returns its result or raises its error."""


class Here(Value):
    """The runner of this process: one piece after the other, when its result is asked for."""

    progress: Progress = no_progress

    def results(self, batch: Batch, pieces: Pieces[R]) -> Iterator[tuple[int, Callable[[], R]]]:
        """The index of each piece, and a function that does it."""
        of_batch = BatchProgress(batch, set(batch.due()) - pieces.kept, self.progress)
        of_batch.start()
        for number in turns(batch, pieces.claim_of, self.progress):
            yield number, partial(pieces.run, number, of_batch.of_piece)
            of_batch.finished(number)
