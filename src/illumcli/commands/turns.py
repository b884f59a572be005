"""The order in which a process does the pieces of a batch, where other processes may be doing it, too."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from itertools import chain
from pathlib import Path

from illumcli.commands.batch import Batch
from illumcli.files.claims import Claims
from illumcli.progress import Progress

WAIT = 0.2
"""Seconds between two looks at the pieces that other processes do."""


def turns(batch: Batch, claim_of: Callable[[int], Path | None], progress: Progress) -> Iterator[int]:
    """The indices of the pieces of a batch that have not failed, each claimed while it is done.

    A process alone takes them in order. Where the next piece is claimed by another process, this one goes on
    in the middle of what is left: both then do pieces that follow each other, which share buffers. Pieces
    that others have claimed come last: when they are done, or free again because their process has died.

    Parameters
    ----------
    claim_of
        The path of the claim on a piece; None for a piece that needs none.
    """
    claims, left, refused, at = Claims(), set(batch.due()), set[int](), 0
    while left:
        # The next piece that nobody else is known to do.
        in_order = chain(range(at, batch.count), range(at))
        upcoming = next((number for number in in_order if number in left and number not in refused), None)
        if upcoming is None:
            progress("waiting for another process", batch.count - len(left), batch.count)
            time.sleep(WAIT)
            refused.clear()
            at = 0
            continue
        at = upcoming

        # Do it, unless another process is doing it.
        if not batch.is_due(at):
            left.discard(at)
            continue
        path = claim_of(at)
        claim = claims.take(path) if path is not None else nullcontext()
        if claim is not None:
            left.discard(at)
            with claim:
                yield at
            continue

        # Go on in the middle of what is left.
        refused.add(at)
        free = sorted(left - refused)
        later = [number for number in free if number > at] or free
        at = later[len(later) // 2] if later else 0
