"""Some pieces of a batch that a worker does one after the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from illumcli.records import Value

BLOCKS = 4
"""Blocks per worker that the pieces left are cut into: all workers end at about the same time."""
SECONDS = 1.0
"""What a block takes at most, unless it is a single piece: this much is lost with a worker that dies."""


class Block(Value):
    """Pieces of a batch by their indices."""

    numbers: tuple[int, ...]
    attempt: int = 0
    failed_on: frozenset[str] = frozenset()
    """Workers that had no room for it."""
    contents: Mapping[Path, bytes] | None = None
    """Files that a worker asked for."""
    asker: str | None = None
    """The worker that asked for them."""
    losses: int = 0
    """How often all workers vanished that it was given to."""

    def again(self) -> Block:
        """The same block, to be given out once more."""
        return replace(self, attempt=self.attempt + 1)

    def one_by_one(self) -> list[Block]:
        """A block of each piece."""
        return [replace(self.again(), numbers=(number,), losses=0) for number in self.numbers]

    def among(self, workers: frozenset[str]) -> frozenset[str]:
        """Those of the workers that may do it."""
        if self.asker in workers:
            return frozenset({self.asker})
        return workers - self.failed_on or workers


def block_size(left: int, workers: int, seconds: float) -> int:
    """Number of pieces of the next block.

    Parameters
    ----------
    left : int
        Pieces that are not given out.
    seconds : float
        What a piece takes; infinity as long as nobody knows.
    """
    return max(1, min(left // (BLOCKS * workers), int(SECONDS / seconds)))
