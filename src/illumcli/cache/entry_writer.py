"""Writes an entry under a temporary name; it gets its own name once it is whole."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from illumcli.cache.entry import FORMAT, HEADER, MAGIC, Refused, checksum, pieces
from illumcli.files import atomic

if TYPE_CHECKING:
    from illumcli.cache.store import Store


class Writer:
    """Writes one entry: arrays in their order, each in pieces; then `commit` or `discard`."""

    def __init__(
        self, store: Store, part: Path, target: Path, text: bytes, places: Sequence[int], end: int
    ) -> None:
        self._store, self._part, self._target, self._text = store, part, target, text
        self._start = HEADER.size + len(text)
        self._at = [self._start + place for place in places]  # offset of the next piece of each array
        self._end = end
        self.bytes = self._start + end
        self._failed = False
        self._number = 0
        atomic.track(part)
        handle = atomic.created(part)
        try:
            self._file = os.fdopen(handle, "r+b", buffering=0)
        except OSError:
            os.close(handle)
            part.unlink()
            atomic.untrack(part)
            raise
        self._try(lambda: self._file.truncate(self._start + end))

    def write(self, array: NDArray[Any]) -> None:
        """Write the next array in one piece."""
        self.append(self._number, array)
        self._number += 1

    def append(self, number: int, piece: NDArray[Any]) -> None:
        """Write the next piece of array `number`."""
        data = np.ascontiguousarray(piece).reshape(-1).view(np.uint8)
        at = self._at[number]
        self._at[number] += data.nbytes
        self._try(lambda: _write_at(self._file, data, at))

    def commit(self) -> bool:
        """Give the entry its name; False if any write failed."""
        self._try(self._finish)
        return not self._failed

    def discard(self) -> None:
        """Remove the temporary file."""
        self._failed = True
        with suppress(OSError):
            self._file.close()
        with suppress(OSError):
            self._part.unlink()
        atomic.untrack(self._part)

    def _finish(self) -> None:
        head = HEADER.pack(MAGIC, FORMAT, len(self._text), self._end, b"")[:24]
        _write_at(self._file, np.frombuffer(self._text, np.uint8), HEADER.size)
        arrays = pieces(self._file.fileno(), self._start, self._end)
        sum_ = checksum(head + self._text, arrays)
        _write_at(self._file, np.frombuffer(head + sum_ + bytes(8), np.uint8), 0)
        os.replace(self._part, self._target)  # not forced to disk: every reader verifies it
        with suppress(OSError):
            self._file.close()
        atomic.untrack(self._part)
        self._store.saved(self._target.stem, self.bytes)

    def _try(self, action: Callable[[], object]) -> None:
        if self._failed:
            return
        try:
            action()
        except (OSError, Refused) as error:
            self._store.refused(error)
            self.discard()


def _write_at(file: BinaryIO, data: NDArray[np.uint8], at: int) -> None:
    view = data.data
    while view:
        count = os.pwrite(file.fileno(), view, at)
        view, at = view[count:], at + count
