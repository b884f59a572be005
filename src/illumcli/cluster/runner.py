"""Does the pieces of a batch on the workers of a cluster.

Units that follow each other share buffers, so a worker is given a block of them. The scheduler holds a few
blocks per worker, the others wait here. The client knows every unit whose result it has: whatever happens to
workers or to the scheduler, only units without a result are given out again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from illumcli.cluster.address import Address
from illumcli.cluster.block import Block, block_size
from illumcli.cluster.connection import SchedulerLost
from illumcli.cluster.inputs import scene_of
from illumcli.cluster.local import preload
from illumcli.cluster.session import Session
from illumcli.cluster.tasks import Tasks, raised
from illumcli.commands.batch import Batch
from illumcli.commands.batch_progress import BatchProgress
from illumcli.commands.runner import Pieces
from illumcli.errors import IllumError
from illumcli.files.atomic import no_space_left, write_bytes
from illumcli.progress import Progress, no_progress

if TYPE_CHECKING:
    from distributed import Future

    from illumcli.cluster.task import BlockResult, UnitResult

HELD = 2
"""Blocks per worker that the scheduler holds."""
TRIES = 3
"""Workers on which a unit may fail for a reason that lies with the worker."""

R = TypeVar("R")


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
        if address.local:
            preload()

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
            tasks = Tasks(batch, pieces, due, len(session.workers()))
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


class _Blocks:
    """The blocks of units: those left, those that are to be done again, those given out."""

    def __init__(self, session: Session, tasks: Tasks[Any]) -> None:
        self._session, self._tasks = session, tasks
        self._left, self._again = deque(range(len(tasks))), deque[Block]()
        self._given: dict[Future, tuple[Block, frozenset[str]]] = {}  # and its workers; none for any
        self._seconds = inf  # of a unit
        self._is_first_alone = tasks.is_first_alone

    def results(self) -> Iterator[tuple[int, Callable[[], Any]]]:
        """The number of each unit, and a function that returns its result or raises its error."""
        while self._left or self._again or self._given:
            try:
                yield from self._turn()
            except SchedulerLost:
                self._again += [block.again() for block, _ in self._given.values()]
                self._given.clear()
                self._session.reconnect()

    def _turn(self) -> Iterator[tuple[int, Callable[[], Any]]]:
        """Give out blocks, wait for some, and yield the results of their units."""
        from distributed import KilledWorker

        workers = self._session.workers()
        yield from self._taken_back(workers)
        self._give_out(workers)
        for future, outcome in self._session.outcomes():
            if future not in self._given:  # taken back, or of a scheduler that is lost
                continue
            if isinstance(outcome, Exception) and not isinstance(outcome, KilledWorker):
                raise outcome
            block, _ = self._given.pop(future)
            if isinstance(outcome, Exception):
                yield from self._killed(block)
            else:
                yield from self._results(block, outcome, workers)
            self._is_first_alone = False

    def _taken_back(self, workers: frozenset[str]) -> Iterator[tuple[int, Callable[[], Any]]]:
        """Take back blocks for workers that are all gone: Dask would keep them for ever. Yields the
        errors of those that were lost too often."""
        for future, (block, among) in list(self._given.items()):
            if among and not among & workers and not future.done():
                self._session.cancel(future)
                del self._given[future]
                if block.losses < TRIES:
                    self._again.append(replace(block.again(), losses=block.losses + 1))
                else:
                    yield from self._killed(block)

    def _give_out(self, workers: frozenset[str]) -> None:
        """Give blocks to the scheduler, until it holds enough of them."""
        most = 1 if self._is_first_alone else HELD * len(workers)
        while (self._left or self._again) and len(self._given) < most:
            block = self._again.popleft() if self._again else self._next(len(workers))
            due = tuple(number for number in block.numbers if self._tasks.is_due(number))
            if not due:
                continue
            block, among = replace(block, numbers=due), block.among(workers)
            if among == workers and not self._session.has_set_aside:
                among = frozenset()
            units = [self._tasks.unit(number) for number in due]
            following = self._tasks.unit(self._left[0]) if self._left else None
            future = self._session.submit(block, units, following, among, self._is_first_alone)
            self._given[future] = block, among

    def _next(self, workers: int) -> Block:
        """The next units of those left."""
        count = 1 if self._is_first_alone else block_size(len(self._left), workers, self._seconds)
        return Block(tuple(self._left.popleft() for _ in range(count)))

    def _results(
        self, block: Block, result: BlockResult, workers: frozenset[str]
    ) -> Iterator[tuple[int, Callable[[], Any]]]:
        """The results of the units of a block; those that a worker could not do are given out again.

        Raises
        ------
        InputError
            All workers differ from this process.
        RuntimeError
            A fault of the program.
        """
        if result.fault:
            scene = scene_of(self._tasks.unit(block.numbers[0]))
            raise RuntimeError(f"worker {result.worker}, {scene}:\n{result.fault}")
        if result.differences:
            self._session.set_aside(result.worker, result.differences)
            self._again.append(block.again())
            return
        if result.lacks_files:
            contents = self._session.contents(result.lacking)
            self._again.append(replace(block.again(), contents=contents, asker=result.worker))
            return
        self._seconds = result.seconds / len(block.numbers)
        failed_on = block.failed_on | {result.worker}
        has_others = bool(workers - failed_on) and len(failed_on) < TRIES
        for number, done in zip(block.numbers, result.done, strict=True):
            if done.lies_with_worker and has_others:
                self._again.append(Block((number,), block.attempt + 1, failed_on))
            else:
                yield number, partial(_result, done)

    def _killed(self, block: Block) -> Iterator[tuple[int, Callable[[], Any]]]:
        """The units of a block that killed its workers are given out one by one; or the error of one."""
        if len(block.numbers) > 1:
            self._again += block.one_by_one()
            return
        scene = scene_of(self._tasks.unit(block.numbers[0]))
        fact = "every worker that rendered it died, most often for want of memory"
        failure = IllumError(
            f"{scene}: {fact}; give workers more memory, or make the film or its textures smaller"
        )
        yield block.numbers[0], partial(raised, failure)


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
