"""Does the pieces of a batch on the workers of a cluster.

Blocks of pieces that follow each other, which share buffers, are tasks; large ones come first. The scheduler
holds a few per worker, the others wait here. The client knows every piece whose result it has: whatever
happens to workers or to the scheduler, only pieces without a result are given out again.
"""

from __future__ import annotations

import time
from collections import defaultdict, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from illumcli.cache.fingerprint import digest
from illumcli.cluster.address import Address
from illumcli.cluster.inputs import scene_of
from illumcli.cluster.session import Session
from illumcli.commands.batch import Batch
from illumcli.commands.batch_progress import BatchProgress
from illumcli.commands.runner import Pieces
from illumcli.commands.unit import Unit
from illumcli.errors import IllumError, InputError
from illumcli.files.atomic import no_space_left, write_bytes
from illumcli.progress import Progress, no_progress
from illumcli.records import Value

if TYPE_CHECKING:
    from distributed import Future

    from illumcli.cluster.task import BlockResult, UnitResult

HELD = 2
"""Blocks per worker that the scheduler holds."""
BLOCKS, LARGEST = 4, 32
"""Blocks per worker that the pieces left are cut into, and pieces of the largest block."""
TRIES = 3
"""Workers on which a piece may fail for a reason that lies with the worker."""
POLL = 0.02
"""Seconds between two looks at what is done."""


R = TypeVar("R")


class Block(Value):
    """Some pieces that a worker does one after the other."""

    numbers: tuple[int, ...]
    attempt: int = 0
    failed_on: frozenset[str] = frozenset()
    """Workers that had no room for it."""
    contents: Mapping[Path, bytes] | None = None
    """Files that a worker asked for."""
    asker: str | None = None
    """The worker that asked for them."""
    among: frozenset[str] = frozenset()
    """Workers that it was given to; empty for any."""


class ClusterRunner:
    """A `Runner`: does pieces on a cluster.

    Parameters
    ----------
    is_mixed : bool
        Workers may differ from this process in versions and instructions.
    tell : callable
        Called with warnings.
    """

    def __init__(
        self, address: Address, is_mixed: bool, tell: Callable[[str], None], progress: Progress
    ) -> None:
        self._address, self._is_mixed, self._tell = address, is_mixed, tell
        self._progress = progress

    def results(self, batch: Batch, pieces: Pieces[R]) -> Iterator[tuple[int, Callable[[], R]]]:
        """The index of each piece, in the order in which they are done, and a function that returns its
        result or raises its error."""
        due = [number for number in batch.due() if number not in pieces.kept]
        for number in sorted(pieces.kept):
            yield number, partial(pieces.run, number, no_progress)
        if not due:
            return
        session = Session(self._address, self._is_mixed, self._tell)
        try:
            tasks = _Tasks(batch, pieces, due, len(session.workers()))
            of_batch = BatchProgress(batch, due, self._progress)
            of_batch.start()
            for task, result in _Blocks(session, tasks).results():
                number = tasks.number(task)
                if whole := tasks.taken(task, result):
                    yield number, whole
                    of_batch.finished(number)
                else:
                    of_batch.of_piece("bands", *tasks.progress(number))
        finally:
            session.close()


class _Tasks(Generic[R]):
    """The units of the pieces that are due, numbered from 0; a piece that is cut has several."""

    def __init__(self, batch: Batch, pieces: Pieces[R], due: Sequence[int], workers: int) -> None:
        self._batch, self._pieces = batch, pieces
        self._cut = pieces.cut() if pieces.cut else None
        self._parts = self._cut.parts(due, workers) if self._cut else {}
        self._places = [
            (number, part) for number in due for part in range(len(self._parts.get(number, (number,))))
        ]
        self._results: dict[int, dict[int, Callable[[], R]]] = defaultdict(dict)
        # What the pieces of one scene share is made by the first, before the others start.
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


class _Blocks:
    """The blocks of units: those left, those that are to be done again, those given out."""

    def __init__(self, session: Session, tasks: _Tasks[Any]) -> None:
        self._session, self._tasks, self._unit_of = session, tasks, tasks.unit
        self._left, self._again = deque(range(len(tasks))), deque[Block]()
        self._given: dict[Future, Block] = {}
        self._is_first_alone = tasks.is_first_alone

    def results(self) -> Iterator[tuple[int, Callable[[], Any]]]:
        """The number of each unit, and a function that returns its result or raises its error."""
        while self._left or self._again or self._given:
            self._take_back()
            self._give_out()
            done = [future for future in self._given if future.done()]
            for future in done:
                block = self._given.pop(future)
                self._is_first_alone = False
                if future.status == "finished":
                    yield from self._taken(block, future.result())
                elif future.status == "error":
                    yield from self._failed(block, future.exception())
                else:  # the scheduler, or this task on it, is lost
                    self._again.append(replace(block, attempt=block.attempt + 1))
            if self._session.is_lost:
                self._again += [replace(each, attempt=each.attempt + 1) for each in self._given.values()]
                self._given.clear()
                self._session.reconnect()
            elif not done:
                time.sleep(POLL)

    def _take_back(self) -> None:
        """Take back blocks for workers that are all gone: Dask would keep them for ever, loose or not."""
        workers = frozenset(self._session.workers())
        lost = [
            future
            for future, block in self._given.items()
            if block.among and not block.among & workers and not future.done()
        ]
        for future in lost:
            block = self._given.pop(future)
            future.cancel()
            self._again.append(replace(block, attempt=block.attempt + 1))

    def _give_out(self) -> None:
        """Give blocks to the scheduler, until it holds enough of them."""
        workers = frozenset(self._session.workers())
        most = 1 if self._is_first_alone else HELD * len(workers)
        while (self._left or self._again) and len(self._given) < most:
            block = self._again.popleft() if self._again else self._next(len(workers))
            due = tuple(number for number in block.numbers if self._tasks.is_due(number))
            if not due:
                continue
            others = workers - block.failed_on if block.failed_on else frozenset[str]()
            among = frozenset({block.asker}) & workers if block.asker else others
            block = replace(block, numbers=due, among=among)
            units = [self._unit_of(number) for number in due]
            key = digest((due, block.attempt))
            future = self._session.submit(units, key, block.contents, among)
            self._given[future] = block

    def _next(self, workers: int) -> Block:
        """The next pieces: a part of those left, so that all workers end at about the same time."""
        size = min(LARGEST, max(1, len(self._left) // (BLOCKS * workers)))
        count = 1 if self._is_first_alone else min(size, len(self._left))
        return Block(tuple(self._left.popleft() for _ in range(count)))

    def _taken(self, block: Block, result: BlockResult) -> Iterator[tuple[int, Callable[[], Any]]]:
        """The results of a block, or the block again with the files that the worker lacks.

        Raises
        ------
        InputError
            The worker differs from this process.
        RuntimeError
            A fault of the program.
        """
        if result.refusal:
            raise InputError(result.refusal)
        if result.fault:
            scene = scene_of(self._unit_of(block.numbers[0]))
            raise RuntimeError(f"worker {result.worker}, {scene}:\n{result.fault}")
        if result.lacks_files:
            contents = self._session.contents(result.lacking)
            asked = replace(block, attempt=block.attempt + 1, contents=contents, asker=result.worker)
            self._again.append(asked)
            return
        for number, done in zip(block.numbers, result.done, strict=True):
            failed_on = block.failed_on | {result.worker}
            others = set(self._session.workers()) - failed_on
            if done.lies_with_worker and others and len(failed_on) < TRIES:
                self._again.append(Block((number,), block.attempt + 1, failed_on))
            else:
                yield number, partial(_result, done)

    def _failed(self, block: Block, error: BaseException | None) -> Iterator[tuple[int, Callable[[], Any]]]:
        """The pieces of a block that killed its workers, one by one, or their errors."""
        from distributed import KilledWorker

        if not isinstance(error, KilledWorker):
            raise error or IllumError("--cluster: a task failed without a reason")
        if len(block.numbers) > 1:
            attempt = block.attempt + 1
            self._again += [Block((number,), attempt, block.failed_on) for number in block.numbers]
            return
        scene = scene_of(self._unit_of(block.numbers[0]))
        fact = "every worker that rendered it died, most often for want of memory"
        failure = IllumError(
            f"{scene}: {fact}; give workers more memory, or make the film or its textures smaller"
        )
        yield block.numbers[0], partial(_raise, failure)


def _result(done: UnitResult) -> Any:
    """The result of a unit, with its files written where workers could not.

    Raises
    ------
    IllumError
        The error of the unit; a file that cannot be written.
    """
    if done.error is not None:
        raise done.error from (no_space_left() if done.is_disk_full else None)
    for name, content in done.contents.items():
        path = Path(name)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(path, content)
    return done.result


def _settled(result: Callable[[], R]) -> Callable[[], R]:
    """A function that returns a result, whose files are written now, or raises its error."""
    try:
        value = result()
    except IllumError as error:
        return partial(_raise, error)
    return lambda: value


def _raise(error: IllumError) -> Any:
    raise error
