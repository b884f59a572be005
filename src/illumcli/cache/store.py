"""The cache on disk: named arrays in files of a cache folder.

Entries are never modified: they are written under a temporary name, renamed, and later removed; processes may
share a folder. A damaged entry is a miss and is computed again.

The folder and its entries must be writable by the user and root alone; otherwise the store neither reads nor
writes.
"""

from __future__ import annotations

import json
import os
import re
import stat
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from illumcli.cache.entry import HEADER, LONGEST, Refused, Stored, array_places, other_writers, read_entry
from illumcli.cache.entry_writer import Writer
from illumcli.files import atomic
from illumcli.records import Value

SUFFIX = ".illum"
ABANDONED = 86400  # [s] a temporary file that was not written to for so long is removed, even if it is locked
LIMIT = 4 << 30
"""Bytes that all entries together may take, unless ILLUM_CACHE_SIZE says otherwise."""
LARGEST_SHARE = 4
"""The largest entry takes the limit divided by this."""
SMALL, COUNTED = 1024, "00"
"""A run that adds less than the limit divided by `SMALL` does not prune, unless one of its keys begins with
`COUNTED`, as one of 256 does: on average the limit is exceeded by a quarter at most."""

_ENTRY = re.compile(r"[0-9a-f]+\.illum")
_PART = re.compile(r"\.[0-9a-f]+\.[0-9]+\.[0-9a-f]{8}\.part")
_ENTRY_OR_PART = re.compile(f"{_ENTRY.pattern}|{_PART.pattern}")
"""Names of the files that the store writes: it neither reads nor removes others in its folder."""


class Entry(Value):
    """A file of the store."""

    path: Path
    bytes: int
    used: float  # seconds since the epoch

    @property
    def key(self) -> str:
        return self.path.stem


class Pruned(Value):
    """The entries that were removed, or should have been."""

    gone: tuple[Entry, ...]
    stayed: Mapping[Path, str]
    """Entry that could not be removed -> why."""


class Store:
    """Entries by key in one folder.

    If the folder cannot be read or written, or others can write to it, runs only take longer: `warning` holds
    the first problem. After one failed write nothing more is written.
    """

    def __init__(self, folder: Path, limit: int = LIMIT) -> None:
        self.folder = folder
        self.limit = limit
        self.warning: str | None = None
        self._writes = True
        self._fresh = 0  # bytes added since the last pruning
        self._counts = False  # True if the end of this run prunes

    @property
    def largest(self) -> int:
        """The greatest size of an entry [bytes]."""
        return self.limit // LARGEST_SHARE

    def has(self, key: str) -> bool:
        """True if there is an entry of this key, valid or not."""
        return self._is_trusted() and os.path.isfile(self._path(key))

    def read(self, key: str) -> Stored | None:
        """The entry of this key, whose time of use becomes now; None if there is no valid one."""
        path = self._path(key)
        if not self._is_trusted():
            return None
        try:
            with suppress(OSError):
                os.utime(path, follow_symlinks=False)
            return read_entry(path, key, self.largest)
        except FileNotFoundError:
            return None
        except OSError as error:
            self._warn(f"{path}: cannot be read: {error.strerror or error}")
        except MemoryError:
            self._warn(f"{path}: not read, it would take too much of the memory that is free")
        except Refused as fact:
            self.reject(key, str(fact))
        return None

    def reject(self, key: str, fact: str) -> None:
        """Remove an entry that cannot be used; `fact` is the reason."""
        path = self._path(key)
        self._warn(f"{path}: {fact}; it is computed again")
        removed(path)

    def save(self, key: str, about: Mapping[str, Any], arrays: Sequence[NDArray[Any]]) -> bool:
        """Write arrays under this key; False if they are too large or cannot be written."""
        shapes = [(array.shape, array.dtype) for array in arrays]
        writer = self.writer(key, about, shapes)
        if writer is None:
            return False
        for array in arrays:
            writer.write(array)
        return writer.commit()

    def writer(
        self, key: str, about: Mapping[str, Any], shapes: Sequence[tuple[tuple[int, ...], Any]]
    ) -> Writer | None:
        """A writer of arrays of these shapes and types; None if nothing can be written."""
        places, end = array_places(shapes)
        if not self._writes or end > self.largest or not self._is_trusted():
            return None
        described = {"key": key, "about": about, "arrays": places}
        text = json.dumps(described, separators=(",", ":")).encode()
        text += b" " * (-(len(text) + HEADER.size) % 64)
        if len(text) > LONGEST:
            return None
        part = self.folder / f".{key}.{os.getpid()}.{os.urandom(4).hex()}.part"
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not self._is_trusted():  # another process created it
                return None
            return Writer(self, part, self._path(key), text, [place["at"] for place in places], end)
        except OSError as error:
            self.refused(error)
            return None

    def refused(self, error: OSError | Refused) -> None:
        """Note a failed write; nothing more is written."""
        self._writes = False
        fact = getattr(error, "strerror", None) or error
        self._warn(f"{self.folder}: cannot be written: {fact}; nothing more is kept there")

    def saved(self, key: str, size: int) -> None:
        """Note that an entry of so many bytes was added."""
        self._fresh += size
        self._counts |= self._fresh * SMALL > self.limit or key.startswith(COUNTED)
        # A long run exceeds the limit by at most the largest entry.
        if self._fresh > self.largest:
            self._prune()

    def finish(self) -> None:
        """Remove temporary files of killed runs; prune if this run added much, or a key of `COUNTED`.

        Counting takes 10 us per entry: after every small run, it would take time quadratic in their number.
        """
        if self._writes and self._is_trusted():
            if self._counts:
                self._prune()
            else:
                self._remove_left_over()

    def _prune(self) -> None:
        """Prune; entries that cannot be removed are a warning."""
        self._fresh, self._counts = 0, False
        for path, fact in self.prune(self.limit).stayed.items():
            self._warn(f"{path}: cannot be removed: {fact}; the cache takes more than its limit")

    def entries(self) -> list[Entry]:
        """Every entry, the least recently used first."""
        files = sorted((used, name, size) for name, size, used in self._files(_ENTRY))
        return [Entry(self.folder / name, size, used) for used, name, size in files]

    def faults(self) -> dict[Path, str]:
        """Entry -> what is wrong with it, of those that are not valid."""
        faults = {}
        for entry in self.entries():
            try:
                read_entry(entry.path, entry.key, LIMIT)
            except (FileNotFoundError, MemoryError):
                continue  # removed by another process; too large to read
            except (OSError, Refused) as error:
                faults[entry.path] = str(error)
        return faults

    def prune(self, limit: int) -> Pruned:
        """Remove the least recently used entries until all, with unfinished ones, fit into `limit` bytes."""
        self._remove_left_over()
        # Without a list if everything fits: a record takes a kilobyte.
        if sum(size for _, size, _ in self._files(_ENTRY_OR_PART)) <= limit:
            return Pruned((), {})

        # Remove entries in the order of their last use.
        entries, gone, stayed = self.entries(), [], {}
        total = sum(entry.bytes for entry in entries) + sum(size for _, size, _ in self._files(_PART))
        for entry in entries:
            if total <= limit:
                break
            fact = removed(entry.path)
            if fact is None:
                total -= entry.bytes
                gone.append(entry)
            else:
                stayed[entry.path] = fact
        return Pruned(tuple(gone), stayed)

    def _remove_left_over(self) -> None:
        """Remove the temporary files of killed runs."""
        for name, _, used in list(self._files(_PART)):
            if time.time() - used > ABANDONED:
                removed(self.folder / name)
            else:
                atomic.remove_abandoned(self.folder / name)

    def _is_trusted(self) -> bool:
        """True if only the user and root can write to the folder, or it does not exist."""
        fact = distrust(self.folder)
        if fact is not None:
            self._warn(f"{self.folder}: {fact}; nothing is read or kept there")
        return fact is None

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}{SUFFIX}"

    def _files(self, names: re.Pattern[str]) -> Iterator[tuple[str, int, float]]:
        """Name, bytes and last use [s since the epoch] of each file whose name is one of `names`."""
        with suppress(OSError), os.scandir(self.folder) as listing:
            for each in listing:
                if names.fullmatch(each.name):  # most fail at their first letter
                    with suppress(OSError):
                        status = each.stat(follow_symlinks=False)
                        if not stat.S_ISDIR(status.st_mode):
                            yield each.name, status.st_size, status.st_mtime

    def _warn(self, text: str) -> None:
        self.warning = self.warning or f"cache: {text}"


def distrust(folder: Path) -> str | None:
    """Why the folder cannot be trusted, and what to do; None if only the user and root can write to it, or it
    does not exist."""
    try:
        link, status = os.lstat(folder), os.stat(folder)
    except OSError:
        return None
    advice = f"chmod go-w {folder}, or name another folder by ILLUM_CACHE"
    return other_writers(link, advice) or other_writers(status, advice)


def removed(path: Path) -> str | None:
    """Remove a file of the store; the reason if that fails, otherwise None."""
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        return error.strerror or str(error)
    return None
