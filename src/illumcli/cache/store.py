"""The cache on disk: named arrays in files of a cache folder, verified whenever they are read.

An entry is a header of 64 bytes, a description as JSON, and the arrays, each aligned to 64 bytes. The
checksum in the header covers all other bytes, so a damaged or truncated entry is a miss and is computed
again. Entries are never modified: they are written under a temporary name, renamed, and later removed;
processes may share a folder. Entries are read, not mapped: truncating a mapped file kills the process, and
changing one would bypass the check.

The checksum detects accidental damage, not forgery. The folder and its entries must therefore be writable by
the user and root alone; otherwise the store neither reads nor writes.

References
----------
Carter, J. L. and Wegman, M. N. (1979). Universal classes of hash functions. JCSS 18(2): the multilinear sum.
"""

from __future__ import annotations

import errno
import hashlib
import json
import math
import os
import re
import stat
import struct
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.files import atomic
from illumcli.memory import free_memory
from illumcli.records import Record, Value

SUFFIX = ".illum"
ABANDONED = 86400  # [s] a temporary file that was not written to for so long is removed, even if it is locked
LIMIT = 4 << 30
"""Bytes that all entries together may take, unless ILLUM_CACHE_SIZE says otherwise."""
LARGEST_SHARE = 4
"""The largest entry takes the limit divided by this."""
SMALL, COUNTED = 1024, "00"
"""A run that adds less than the limit divided by `SMALL` does not prune, unless one of its keys begins with
`COUNTED`, as one of 256 does: on average the limit is exceeded by a quarter at most."""
LONGEST = 1 << 24  # [bytes] of a description
LARGE = 1 << 26
"""An entry of so many bytes is read only if it takes at most `MEMORY_SHARE` of the free memory."""
MEMORY_SHARE = 0.5

_HEADER = struct.Struct("<8sIIQ32s8x")  # magic, format, length of the description, of the arrays, checksum
_MAGIC, _FORMAT = b"illum\r\n\0", 1
_WORDS = 8192  # words of 8 bytes that one sum covers
_PIECE = 16 * 8 * _WORDS  # [bytes] read at a time: summed while they are in the processor's cache
_TYPE = re.compile("[<>|][biuf][1248]")
_ENTRY = re.compile(r"[0-9a-f]+\.illum")
_PART = re.compile(r"\.[0-9a-f]+\.[0-9]+\.[0-9a-f]{8}\.part")
_ENTRY_OR_PART = re.compile(f"{_ENTRY.pattern}|{_PART.pattern}")
"""Names of the files that the store writes: it neither reads nor removes others in its folder."""
_UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}


class Refused(Exception):
    """A file in the folder is not a valid entry; the text says why."""


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


class Stored(Record):
    """An entry that was read and verified. Its arrays are read-only."""

    about: Mapping[str, Any]
    arrays: tuple[NDArray[Any], ...]
    bytes: int


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
        places, end = _places(shapes)
        if not self._writes or end > self.largest or not self._is_trusted():
            return None
        described = {"key": key, "about": about, "arrays": places}
        text = json.dumps(described, separators=(",", ":")).encode()
        text += b" " * (-(len(text) + _HEADER.size) % 64)
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
                read_entry(entry.path, entry.key)
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


class Writer:
    """Writes one entry: arrays in their order, each in pieces; then `commit` or `discard`."""

    def __init__(
        self, store: Store, part: Path, target: Path, text: bytes, places: Sequence[int], end: int
    ) -> None:
        self._store, self._part, self._target, self._text = store, part, target, text
        self._start = _HEADER.size + len(text)
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
        head = _HEADER.pack(_MAGIC, _FORMAT, len(self._text), self._end, b"")[:24]
        _write_at(self._file, np.frombuffer(self._text, np.uint8), _HEADER.size)
        pieces = _pieces(self._file.fileno(), self._start, self._end)
        sum_ = checksum(head + self._text, pieces)
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


def distrust(folder: Path) -> str | None:
    """Why the folder cannot be trusted, and what to do; None if only the user and root can write to it, or it
    does not exist."""
    try:
        link, status = os.lstat(folder), os.stat(folder)
    except OSError:
        return None
    advice = f"chmod go-w {folder}, or name another folder by ILLUM_CACHE"
    return _other_writers(link, advice) or _other_writers(status, advice)


def _other_writers(status: os.stat_result, advice: str) -> str | None:
    """Who beside the user and root can write to a file or folder, and what to do; None if nobody can."""
    if status.st_uid not in (0, os.geteuid()):
        return f"belongs to another user ({status.st_uid}); name a folder of your own by ILLUM_CACHE"
    if not stat.S_ISLNK(status.st_mode) and status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"others can write to it; {advice}"
    return None


def removed(path: Path) -> str | None:
    """Remove a file of the store; the reason if that fails, otherwise None."""
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        return error.strerror or str(error)
    return None


def described(path: Path) -> dict[str, Any]:
    """The description of an entry, whose checksum is not verified.

    Raises
    ------
    OSError
    Refused
    """
    with _opened(path) as file:
        return _description(_head(file)[2])


def read_entry(path: Path, key: str, largest: int = LIMIT) -> Stored:
    """The entry at `path`, verified; it must have this key and at most `largest` bytes.

    Raises
    ------
    OSError
    Refused
    MemoryError
    """
    # Read the arrays in pieces, and verify the checksum of all bytes.
    with _opened(path) as file:
        head, end, text = _head(file)
        size = os.fstat(file.fileno()).st_size
        if end > largest:
            raise Refused("larger than an entry may be")
        free = free_memory() if size >= LARGE else None
        if free is not None and size > MEMORY_SHARE * free:
            raise MemoryError
        start = _HEADER.size + len(text)
        payload = _aligned(end)
        if checksum(head[:24] + text, _pieces(file.fileno(), start, end, payload)) != head[24:56]:
            raise Refused("damaged: its checksum differs")
    payload.flags.writeable = False

    # Find the arrays by the description.
    description = _description(text)
    try:
        if description["key"] != key:
            raise Refused("the entry of another key")
        about = dict(description["about"])
        arrays = tuple(_array(payload, place) for place in description["arrays"])
    except (LookupError, TypeError, ValueError, OverflowError):
        raise Refused("its description is none of an entry") from None
    return Stored(about, arrays, size)


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """The file of an entry, opened without following links; only the user and root may write to it."""
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise Refused("a link, not an entry") from None
        raise
    try:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            raise Refused("not a file")
        if fact := _other_writers(status, "only the user may"):
            raise Refused(fact)
    except Refused:
        os.close(handle)
        raise
    with open(handle, "rb", buffering=0) as file:
        yield file


def _head(file: BinaryIO) -> tuple[bytes, int, bytes]:
    """The header of an entry, the size of its arrays [bytes], and its description as text."""
    size = os.fstat(file.fileno()).st_size
    head = os.pread(file.fileno(), _HEADER.size, 0)
    magic, form, text_size, end, _ = _HEADER.unpack(head.ljust(_HEADER.size, b"\0"))
    if magic != _MAGIC or form != _FORMAT or head[-8:] != bytes(8):
        raise Refused("not an entry of this program")
    if size != _HEADER.size + text_size + end:
        raise Refused(f"has {size} bytes, not {_HEADER.size + text_size + end}")
    if text_size > LONGEST:
        raise Refused("its description is longer than any")
    text = np.empty(text_size, np.uint8)
    for _ in _pieces(file.fileno(), _HEADER.size, text_size, text):
        pass
    return head, end, text.tobytes()


def _description(text: bytes) -> dict[str, Any]:
    """The description of an entry, from its text."""
    try:
        description = json.loads(text)
    except (ValueError, RecursionError):
        raise Refused("damaged: its description cannot be read") from None
    if not isinstance(description, dict):
        raise Refused("its description is none of an entry")
    return description


def checksum(text: bytes, pieces: Iterable[NDArray[np.uint8]]) -> bytes:
    """32 bytes that any change of a word of the data, and any but one in 2^64 of larger damage, changes.

    The data comes in pieces of whole blocks of 64 KiB, except the last. Each block is first reduced to the
    sum of its words times fixed odd numbers modulo 2^64, ten times as fast as a cryptographic hash. That
    detects accidents; an attacker could replace the checksum, too.
    """
    digest = hashlib.blake2b(text, digest_size=32)
    for data in pieces:
        words = data[: len(data) // (8 * _WORDS) * (8 * _WORDS)].view(np.uint64).reshape(-1, _WORDS)
        digest.update((words @ _odd_numbers()).tobytes())
        digest.update(data[words.size * 8 :].data)
    return digest.digest()


@cache
def _odd_numbers() -> NDArray[np.uint64]:
    """(8192,) fixed odd 64-bit numbers: splitmix64 of 1, 2, 3, ..."""
    x = np.arange(1, _WORDS + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        x = (x ^ (x >> np.uint64(shift))) * np.uint64(factor)
    return (x ^ (x >> np.uint64(31))) | np.uint64(1)


def _places(shapes: Sequence[tuple[tuple[int, ...], Any]]) -> tuple[list[dict[str, Any]], int]:
    """The offset of each array after the description, with shape and type, and the end of the last one."""
    places, end = [], 0
    for shape, dtype in shapes:
        places.append({"at": end, "shape": list(shape), "dtype": np.dtype(dtype).str})
        size = int(np.prod(shape, dtype=np.int64)) * np.dtype(dtype).itemsize
        end += size + -size % 64
    return places, end


def _array(payload: NDArray[np.uint8], place: Mapping[str, Any]) -> NDArray[Any]:
    """One of an entry's arrays; a wrong description raises ValueError, TypeError or LookupError."""
    if not _TYPE.fullmatch(place["dtype"]) or any(side < 0 for side in place["shape"]):
        raise ValueError("not an array")
    dtype, count = np.dtype(place["dtype"]), math.prod(place["shape"])
    array = np.frombuffer(payload, dtype, count, place["at"]) if count else np.zeros(0, dtype)
    return array.reshape(place["shape"])


def _aligned(size: int) -> NDArray[np.uint8]:
    """(size,) uninitialised bytes that begin at a multiple of 64."""
    buffer = np.empty(size + 63, np.uint8)
    first = -buffer.ctypes.data % 64
    return buffer[first : first + size]


def _pieces(
    handle: int, start: int, size: int, into: NDArray[np.uint8] | None = None
) -> Iterator[NDArray[np.uint8]]:
    """The `size` bytes of a file from `start` on, piece by piece. Each overwrites the one before, or is
    kept in its place in `into`.

    Raises
    ------
    OSError
    Refused
        The file is shorter.
    """
    scratch = np.empty(min(size, _PIECE), np.uint8) if into is None else into
    for first in range(0, size, _PIECE):
        count = min(_PIECE, size - first)
        piece = scratch[:count] if into is None else scratch[first : first + count]
        at, view = start + first, piece.data
        while view:
            done = os.preadv(handle, [view], at)
            if not done:
                raise Refused("became shorter while it was read")
            view, at = view[done:], at + done
        yield piece


def _write_at(file: BinaryIO, data: NDArray[np.uint8], at: int) -> None:
    view = data.data
    while view:
        count = os.pwrite(file.fileno(), view, at)
        view, at = view[count:], at + count


def open_store() -> Store | None:
    """The store of the environment's folder and limit; None for a user without a home folder.

    Raises
    ------
    InputError
        ILLUM_CACHE_SIZE is no size.
    """
    folder = default_folder()
    try:
        return Store(folder, default_limit()) if folder is not None else None
    except ValueError as error:
        raise InputError(f"ILLUM_CACHE_SIZE: {error}; write it as 500M or 4G") from None


def default_folder() -> Path | None:
    """The folder of entries: ILLUM_CACHE, else `illum` in the user's cache folder (XDG_CACHE_HOME).

    None for a user without a home folder.
    """
    if folder := os.environ.get("ILLUM_CACHE"):
        return Path(folder)
    base = os.environ.get("XDG_CACHE_HOME", "")
    if not os.path.isabs(base):
        base = os.path.join(os.environ.get("HOME", os.path.expanduser("~")), ".cache")
    return Path(base) / "illum" if os.path.isabs(base) else None


def default_limit() -> int:
    """The limit that ILLUM_CACHE_SIZE sets, by default `LIMIT` [bytes]."""
    return size_of(os.environ["ILLUM_CACHE_SIZE"]) if os.environ.get("ILLUM_CACHE_SIZE") else LIMIT


def size_of(text: str) -> int:
    """The number of bytes in a text such as `500M` or `4G`.

    Raises
    ------
    ValueError
    """
    number = text.strip().upper().removesuffix("B").removesuffix("I")
    unit = number[-1:] if number[-1:] in _UNITS else ""
    size = float(number.removesuffix(unit)) * _UNITS[unit]
    if not 0 <= size < 2**60:
        raise ValueError(f"no size: {text}")
    return int(size)
