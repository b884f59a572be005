"""Units of work of a bake, and the threads that compute them."""

from __future__ import annotations

import hashlib
import struct
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import row_blocks
from illumcli.progress import Progress
from illumcli.records import Record

Result = TypeVar("Result")


class WorkUnit(Record):
    """Points of one object that cast equally many rays for a purpose; its result depends on nothing else."""

    points: NDArray[np.int64]
    samples: int
    object: int
    purpose: str = ""

    @property
    def rays(self) -> int:
        """Of all points together."""
        return len(self.points) * self.samples

    def key(self) -> bytes:
        """16 bytes that tell it from every other unit of its bake."""
        digest = hashlib.blake2b(struct.pack("<qq", self.samples, self.object), digest_size=16)
        digest.update(self.purpose.encode())
        digest.update(np.ascontiguousarray(self.points).data)
        return digest.digest()


Compute: TypeAlias = Callable[[WorkUnit, threading.Event], Result]
"""Result of a unit; once the event is set, the result is no longer wanted."""


def run_units(
    purpose: str, units: Sequence[WorkUnit], compute: Compute[Result], threads: int, progress: Progress
) -> Iterator[tuple[int, Result]]:
    """Index and result of each unit, in the order in which they are done.

    When the consumer stops, units that are being computed end soon.
    """
    stop = threading.Event()
    total, done = sum(unit.rays for unit in units), 0
    with ThreadPoolExecutor(threads, thread_name_prefix="bake") as pool:
        try:
            queue = iter(range(len(units)))
            pending: dict[Future[Result], int] = {}
            while True:
                # one unit more than threads, so that none of them waits
                for index in queue:
                    pending[pool.submit(compute, units[index], stop)] = index
                    if len(pending) > threads:
                        break
                if not pending:
                    break
                # a short wait, so that an interrupt reaches this thread
                for future in wait(pending, timeout=0.2, return_when=FIRST_COMPLETED).done:
                    index = pending.pop(future)
                    yield index, future.result()
                    done += units[index].rays
                    progress(purpose, done, total)
        finally:
            stop.set()
            pool.shutdown(wait=True, cancel_futures=True)


def in_blocks(compute: Callable[[slice], None], count: int, threads: int) -> None:
    """Call a function for every block of so many rows, several at a time."""
    with ThreadPoolExecutor(threads, thread_name_prefix="blocks") as pool:
        for _ in pool.map(compute, row_blocks(count)):
            pass
