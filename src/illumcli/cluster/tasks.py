"""The units of the pieces of a batch; a piece that is cut into bands has several."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Generic, TypeVar

from illumcli.cluster.inputs import scene_of
from illumcli.commands.batch import Batch
from illumcli.commands.runner import Pieces
from illumcli.commands.unit import Unit
from illumcli.errors import IllumError

R = TypeVar("R")


class Tasks(Generic[R]):
    """The units of the pieces that are due, numbered from 0; a piece that is cut has several."""

    def __init__(self, batch: Batch, pieces: Pieces[R], due: Sequence[int], workers: int) -> None:
        self._batch, self._pieces = batch, pieces
        self._cut = pieces.cut() if pieces.cut else None
        self._parts = self._cut.parts(due, workers) if self._cut else {}
        self._places = [
            (number, part) for number in due for part in range(len(self._parts.get(number, (number,))))
        ]
        self._results: dict[int, dict[int, Callable[[], R]]] = defaultdict(dict)
        # What the pieces of one scene share is computed by the first, before the others start.
        ends = [scene_of(self.unit(task)) for task in (0, len(self) - 1)]
        self.is_first_alone = len(self) > 1 and ends[0] == ends[1] and not self._parts

    def __len__(self) -> int:
        return len(self._places)

    def number(self, task: int) -> int:
        """The number of a unit's piece."""
        return self._places[task][0]

    def unit(self, task: int) -> Unit:
        """A unit."""
        number, part = self._places[task]
        return self._parts[number][part] if number in self._parts else self._pieces.unit(number)

    def is_due(self, task: int) -> bool:
        """False for a unit of a piece that need not be done any more."""
        return self._batch.is_due(self.number(task))

    def taken(self, task: int, result: Callable[[], R]) -> Callable[[], R] | None:
        """A function that returns the result of a unit's piece, if all of its units are done."""
        number, part = self._places[task]
        if number not in self._parts:
            return result
        results = self._results[number]
        results[part] = _settled(result)
        if len(results) < len(self._parts[number]):
            return None
        return partial(self._joined, number)

    def progress(self, number: int) -> tuple[int, int]:
        """How many units of a piece are done, and how many it has."""
        return len(self._results[number]), len(self._parts[number])

    def _joined(self, number: int) -> R:
        assert self._cut is not None
        results = self._results.pop(number)
        return self._cut.join(number, [results[part]() for part in sorted(results)])


def _settled(result: Callable[[], R]) -> Callable[[], R]:
    """A function that returns a result, whose files are written now, or raises its error."""
    try:
        value = result()
    except IllumError as error:
        return partial(raised, error)
    return lambda: value


def raised(error: IllumError) -> Any:
    """Raise an error where the result is asked for."""
    raise error
