"""What is kept between runs: named arrays in files of a cache folder, checked whenever they are read.

A file is a header of 64 bytes, a description as JSON and the arrays behind it, each at a multiple of 64. The
checksum in the header covers every other byte, so that an entry that is damaged, short or another's is found
out and costs the time to make it again, no more. Entries are never changed: they are written under another
name and renamed, and taken away; processes may share a folder.

References
----------
Carter, J. L. and Wegman, M. N. (1979). Universal classes of hash functions. JCSS 18(2): the multilinear sum.
"""

from __future__ import annotations

import hashlib
import json
import mmap
import os
import struct
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from illumcli.files import atomic
from illumcli.records import Record, Value

SUFFIX = ".illum"
LIMIT = 4 << 30
"""Bytes that all entries together may take, unless ILLUM_CACHE_SIZE says otherwise."""
LARGEST_SHARE = 4
"""No entry takes more than this part of the limit."""
MAPPED = 1 << 20  # [bytes] entries of this size are mapped, smaller ones read
ABANDONED = 3600  # [s] a part file this old belongs to nobody

_HEADER = struct.Struct("<8sIIQ32s8x")  # magic, format, length of the description, of the arrays, checksum
_MAGIC, _FORMAT = b"illum\r\n\0", 1
_WORDS = 8192  # words of 8 bytes that one sum covers
_UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}


class Refused(Exception):
    """A file of the folder is not a sound entry; the text says why."""


class Entry(Value):
    """A file of the store."""

    path: Path
    bytes: int
    used: float  # seconds since the epoch

    @property
    def key(self) -> str:
        return self.path.stem


class Stored(Record):
    """An entry that was read and is sound. Arrays are read-only."""

    about: Mapping[str, Any]
    arrays: tuple[NDArray[Any], ...]
    bytes: int


class Store:
    """Entries by key in one folder. A folder that cannot be read or written costs time only: `warning` says
    what happened first, and from the first refusal on nothing more is written."""

    def __init__(self, folder: Path, limit: int = LIMIT) -> None:
        self.folder = folder
        self.limit = limit
        self.warning: str | None = None
        self._writes = True
        self._saved = False

    @property
    def largest(self) -> int:
        """The most bytes one entry may take."""
        return self.limit // LARGEST_SHARE

    def has(self, key: str) -> bool:
        """Is there an entry of this key, sound or not?"""
        return os.path.exists(self._path(key))

    def read(self, key: str) -> Stored | None:
        """The entry of this key, as used just now; None where there is none or it is not sound."""
        path = self._path(key)
        try:
            found = read_entry(path, key)
        except FileNotFoundError:
            return None
        except OSError as error:
            self._warn(f"{path}: cannot be read: {error.strerror or error}")
            return None
        except Refused as fact:
            self._warn(f"{path}: {fact}; it is made again")
            with suppress(OSError):
                path.unlink()
            return None
        with suppress(OSError):
            os.utime(path)
        return found

    def save(self, key: str, about: Mapping[str, Any], arrays: Sequence[NDArray[Any]]) -> bool:
        """Keep the arrays under this key; False where they are too large or cannot be written."""
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
        """Takes arrays of these shapes and types piece by piece; None where nothing can be written."""
        places, end = _places(shapes)
        if not self._writes or end > self.largest:
            return None
        described = {"key": key, "about": about, "arrays": places}
        text = json.dumps(described, separators=(",", ":")).encode()
        text += b" " * (-(len(text) + _HEADER.size) % 64)
        part = self.folder / f".{key}.{os.getpid()}.{os.urandom(4).hex()}.part"
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            return Writer(self, part, self._path(key), text, [place["at"] for place in places], end)
        except OSError as error:
            self.refused(error)
            return None

    def refused(self, error: OSError) -> None:
        """Note that the operating system refuses to write; nothing more is tried."""
        self._writes = False
        self._warn(f"{self.folder}: cannot be written: {error.strerror or error}; nothing more is kept there")

    def saved(self) -> None:
        """Note that an entry was added."""
        self._saved = True

    def finish(self) -> None:
        """Prune, where this run added anything."""
        if self._saved and self._writes:
            self.prune(self.limit)

    def entries(self) -> list[Entry]:
        """Every entry, the least recently used first."""
        return sorted(self._files(SUFFIX), key=lambda entry: (entry.used, entry.path))

    def faults(self) -> dict[Path, str]:
        """What is wrong with each entry that is not sound."""
        found = {}
        for entry in self.entries():
            try:
                read_entry(entry.path, entry.key)
            except FileNotFoundError:
                continue  # another process was faster
            except (OSError, Refused) as error:
                found[entry.path] = str(error)
        return found

    def prune(self, limit: int) -> list[Entry]:
        """Take the least recently used entries away until all fit into `limit` bytes; those taken."""
        for part in self._files(".part"):
            if time.time() - part.used > ABANDONED:
                with suppress(OSError):
                    part.path.unlink()
        entries, gone = self.entries(), []
        total = sum(entry.bytes for entry in entries)
        for entry in entries:
            if total <= limit:
                break
            with suppress(FileNotFoundError):
                entry.path.unlink()
            total -= entry.bytes
            gone.append(entry)
        return gone

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}{SUFFIX}"

    def _files(self, suffix: str) -> Iterator[Entry]:
        try:
            found = list(os.scandir(self.folder))
        except OSError:
            return
        for each in found:
            if each.name.endswith(suffix):
                with suppress(OSError):
                    status = each.stat(follow_symlinks=False)
                    yield Entry(Path(each.path), status.st_size, status.st_mtime)

    def _warn(self, text: str) -> None:
        self.warning = self.warning or f"cache: {text}"


class Writer:
    """An entry in the making: arrays in their order, each in pieces; then `commit`, or `discard`."""

    def __init__(
        self, store: Store, part: Path, target: Path, text: bytes, places: Sequence[int], end: int
    ) -> None:
        self._store, self._part, self._target, self._text = store, part, target, text
        self._start = _HEADER.size + len(text)
        self._at = [self._start + place for place in places]  # where the next piece of each array goes
        self._end = end
        self.bytes = self._start + end
        self._failed = False
        self._number = 0
        atomic.remember(part)
        self._file: BinaryIO = part.open("w+b")
        self._try(lambda: self._file.truncate(self._start + end))

    def write(self, array: NDArray[Any]) -> None:
        """The next array, whole."""
        self.append(self._number, array)
        self._number += 1

    def append(self, number: int, piece: NDArray[Any]) -> None:
        """The next piece of array `number`."""
        data = np.ascontiguousarray(piece).reshape(-1).view(np.uint8)
        at = self._at[number]
        self._at[number] += data.nbytes
        self._try(lambda: _write_at(self._file, data, at))

    def commit(self) -> bool:
        """Give the entry its name; False where anything failed."""
        self._try(self._finish)
        return not self._failed

    def discard(self) -> None:
        """Leave no trace."""
        self._failed = True
        self._file.close()
        with suppress(OSError):
            self._part.unlink()
        atomic.forget(self._part)

    def _finish(self) -> None:
        head = _HEADER.pack(_MAGIC, _FORMAT, len(self._text), self._end, b"")[:24]
        _write_at(self._file, np.frombuffer(self._text, np.uint8), _HEADER.size)
        payload = _payload(self._file, self._start, self._end)
        sum_ = checksum(head + self._text, payload)
        del payload
        _write_at(self._file, np.frombuffer(head + sum_ + bytes(8), np.uint8), 0)
        self._file.close()
        os.replace(self._part, self._target)
        atomic.forget(self._part)
        self._store.saved()

    def _try(self, action: Any) -> None:
        if self._failed:
            return
        try:
            action()
        except OSError as error:
            self._store.refused(error)
            self.discard()


def described(path: Path) -> dict[str, Any]:
    """What an entry says of itself, not verified.

    Raises
    ------
    OSError
    Refused
    """
    with path.open("rb") as file:
        head = file.read(_HEADER.size)
        if len(head) < _HEADER.size or head[:8] != _MAGIC:
            raise Refused("not an entry of this program")
        try:
            said: dict[str, Any] = json.loads(file.read(min(_HEADER.unpack(head)[2], MAPPED)))
        except (ValueError, RecursionError):
            raise Refused("damaged: its description cannot be read") from None
    return said


def read_entry(path: Path, key: str) -> Stored:
    """The entry at `path`, sound to the last bit and of this key.

    Raises
    ------
    OSError
    Refused
    """
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        head = file.read(_HEADER.size)
        if len(head) < _HEADER.size:
            raise Refused("too short for an entry")
        magic, form, text_size, end, sum_ = _HEADER.unpack(head)
        if magic != _MAGIC or form != _FORMAT or head[-8:] != bytes(8):
            raise Refused("not an entry of this program")
        start = _HEADER.size + text_size
        if size != start + end:
            raise Refused(f"has {size} bytes, not {start + end}")
        text = file.read(text_size)
        payload = _payload(file, start, end)
    if checksum(head[:24] + text, payload) != sum_:
        raise Refused("damaged: its checksum differs")
    said = json.loads(text)
    if said["key"] != key:
        raise Refused("the entry of another key")
    return Stored(said["about"], tuple(_array(payload, place) for place in said["arrays"]), size)


def checksum(text: bytes, data: NDArray[np.uint8]) -> bytes:
    """32 bytes that any change of a word of `data`, and any but one in 2^64 of larger damage, changes.

    Blocks of 64 KiB are first summed up, word by word times fixed odd numbers modulo 2^64, ten times as fast
    as a cryptographic hash: this is to find accidents, an attacker could write the whole entry.
    """
    words = data[: len(data) // (8 * _WORDS) * (8 * _WORDS)].view(np.uint64).reshape(-1, _WORDS)
    digest = hashlib.blake2b(text, digest_size=32)
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
    """Where each array lies behind the description, and where the last one ends."""
    places, end = [], 0
    for shape, dtype in shapes:
        places.append({"at": end, "shape": list(shape), "dtype": np.dtype(dtype).str})
        size = int(np.prod(shape, dtype=np.int64)) * np.dtype(dtype).itemsize
        end += size + -size % 64
    return places, end


def _array(payload: NDArray[np.uint8], place: Mapping[str, Any]) -> NDArray[Any]:
    count = int(np.prod(place["shape"], dtype=np.int64))
    array = np.frombuffer(payload, np.dtype(place["dtype"]), count, place["at"]) if count else np.zeros(0)
    return array.reshape(place["shape"]).astype(place["dtype"], copy=False)


def _payload(file: BinaryIO, start: int, size: int) -> NDArray[np.uint8]:
    """(size,) the bytes of `file` from `start` on, mapped where there are many."""
    if size < MAPPED:
        file.flush()
        return np.frombuffer(os.pread(file.fileno(), size, start), np.uint8)
    whole = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    return np.frombuffer(whole, np.uint8, size, start)


def _write_at(file: BinaryIO, data: NDArray[np.uint8], at: int) -> None:
    view = data.data
    while view:
        count = os.pwrite(file.fileno(), view, at)
        view, at = view[count:], at + count


def default_folder() -> Path | None:
    """Where entries are kept: ILLUM_CACHE, else `illum` in the user's cache folder (XDG_CACHE_HOME).

    None for a user without a home folder.
    """
    if own := os.environ.get("ILLUM_CACHE"):
        return Path(own)
    base = os.environ.get("XDG_CACHE_HOME", "")
    if not os.path.isabs(base):
        base = os.path.join(os.environ.get("HOME", os.path.expanduser("~")), ".cache")
    return Path(base) / "illum" if os.path.isabs(base) else None


def default_limit() -> int:
    """Bytes that ILLUM_CACHE_SIZE allows, `LIMIT` by default."""
    return size_of(os.environ["ILLUM_CACHE_SIZE"]) if os.environ.get("ILLUM_CACHE_SIZE") else LIMIT


def size_of(text: str) -> int:
    """Bytes that a text such as `500M` or `4G` means.

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
