"""The file of an entry: arrays and their description, verified whenever they are read.

An entry is a header of 64 bytes, a description as JSON, and the arrays, each aligned to 64 bytes. The
checksum in the header covers all other bytes, so a damaged or truncated entry is refused. Entries are read,
not mapped: truncating a mapped file kills the process, and changing one would bypass the check.

The checksum detects accidental damage, not forgery: only the user and root may write to an entry.

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
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from illumcli.memory import free_memory
from illumcli.records import Record

LONGEST = 1 << 24  # [bytes] of a description
LARGE = 1 << 26
"""An entry of so many bytes is read only if it takes at most `MEMORY_SHARE` of the free memory."""
MEMORY_SHARE = 0.5

HEADER = struct.Struct("<8sIIQ32s8x")  # magic, format, length of the description, of the arrays, checksum
MAGIC, FORMAT = b"illum\r\n\0", 1
_WORDS = 8192  # words of 8 bytes that one sum covers
_PIECE = 16 * 8 * _WORDS  # [bytes] read at a time: summed while they are in the processor's cache
_TYPE = re.compile("[<>|][biuf][1248]")


class Refused(Exception):
    """A file in the folder is not a valid entry; the text says why."""


class Stored(Record):
    """An entry that was read and verified. Its arrays are read-only."""

    about: Mapping[str, Any]
    arrays: tuple[NDArray[Any], ...]
    bytes: int


def described(path: Path) -> dict[str, Any]:
    """The description of an entry, whose checksum is not verified.

    Raises
    ------
    OSError
    Refused
    """
    with _opened(path) as file:
        return _description(_head(file)[2])


def read_entry(path: Path, key: str, largest: int) -> Stored:
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
        start = HEADER.size + len(text)
        payload = _aligned(end)
        if checksum(head[:24] + text, pieces(file.fileno(), start, end, payload)) != head[24:56]:
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
        if fact := other_writers(status, "only the user may"):
            raise Refused(fact)
    except Refused:
        os.close(handle)
        raise
    with open(handle, "rb", buffering=0) as file:
        yield file


def _head(file: BinaryIO) -> tuple[bytes, int, bytes]:
    """The header of an entry, the size of its arrays [bytes], and its description as text."""
    size = os.fstat(file.fileno()).st_size
    head = os.pread(file.fileno(), HEADER.size, 0)
    magic, form, text_size, end, _ = HEADER.unpack(head.ljust(HEADER.size, b"\0"))
    if magic != MAGIC or form != FORMAT or head[-8:] != bytes(8):
        raise Refused("not an entry of this program")
    if size != HEADER.size + text_size + end:
        raise Refused(f"has {size} bytes, not {HEADER.size + text_size + end}")
    if text_size > LONGEST:
        raise Refused("its description is longer than any")
    text = np.empty(text_size, np.uint8)
    for _ in pieces(file.fileno(), HEADER.size, text_size, text):
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


def array_places(shapes: Sequence[tuple[tuple[int, ...], Any]]) -> tuple[list[dict[str, Any]], int]:
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


def pieces(
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


def other_writers(status: os.stat_result, advice: str) -> str | None:
    """Who beside the user and root can write to a file or folder, and what to do; None if nobody can."""
    if status.st_uid not in (0, os.geteuid()):
        return f"belongs to another user ({status.st_uid}); name a folder of your own by ILLUM_CACHE"
    if not stat.S_ISLNK(status.st_mode) and status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return f"others can write to it; {advice}"
    return None
