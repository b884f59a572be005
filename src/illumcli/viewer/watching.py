"""Files on disk whose change is noticed, by looking at them now and then."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TypeAlias

PERIOD = 0.25
"""Seconds between two looks."""

State: TypeAlias = Mapping[Path, tuple[int, ...] | None]
"""What tells that a file was written: its time, size and number; None where there is no file."""


def state_of(paths: Iterable[Path]) -> State:
    """The state of some files."""
    return {path: _signature(path) for path in paths}


def _signature(path: Path) -> tuple[int, ...] | None:
    try:
        about = path.stat()
    except OSError:
        return None
    return about.st_mtime_ns, about.st_size, about.st_ino


class Watch:
    """Some files, as they were when they were read."""

    def __init__(self) -> None:
        self._read: State = {}
        self._seen: State = {}
        self._looked = time.monotonic()

    def begin(self) -> None:
        """Note that all files are about to be read, as they are now."""
        self._read = self._seen = state_of(self._read)

    def add(self, paths: Iterable[Path]) -> None:
        """Watch more files; those that are watched already count as read when they were."""
        self._read = {**state_of(path for path in paths if path not in self._read), **self._read}
        self._seen = {**self._read, **self._seen}

    def have_changed(self) -> bool:
        """True if files differ from what was read, and were the same at the last two looks: whoever writes
        them is done. Looks at most once in `PERIOD`."""
        if time.monotonic() - self._looked < PERIOD:
            return False
        self._looked = time.monotonic()
        before, self._seen = self._seen, state_of(self._read)
        return self._seen != self._read and self._seen == before
