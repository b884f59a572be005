"""A journal of finished pieces of one long computation, from which an interrupted run resumes.

A header names the computation. Every record has a key and a checksum over computation, key and values, so
records of other computations and damaged records are never used. Records are appended, never changed. One
process at a time holds a journal; a second process with the same computation runs without one.
"""

from __future__ import annotations

import hashlib
import os
import re
import struct
import time
from contextlib import suppress
from pathlib import Path

from illumcli.files.atomic import beside, claim

ABANDONED = 7 * 86400
"""Age after which a computation is not expected to be resumed [seconds]."""
SUFFIX = "unfinished"

_MAGIC = b"illum journal 1\n"
_RECORD = struct.Struct("<Q16s16s")  # bytes of the values, key, checksum
_NAME = re.compile(r"\.[0-9a-f]{12}\.[0-9a-f]+\." + SUFFIX)


class Journal:
    """The journal of one computation, locked until it is closed or removed.

    If the file cannot be opened, nothing is stored, and `refusal` is the reason.

    Parameters
    ----------
    path
        From `place`.
    identity : str
        Hash of everything that the values depend on, in hexadecimal digits.
    """

    def __init__(self, path: Path, identity: str) -> None:
        self.refusal: str | None = None
        self._path = path
        self._identity = identity.encode()
        self._places: dict[bytes, tuple[int, int]] = {}  # key -> offset and size of its values
        self._end = 0
        self._handle: int | None = None
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._handle = claim(path)
            if self._handle is None:
                self.refusal = "it is in use, or not this user's alone"
            else:
                self._read(self._handle)
        except OSError as error:
            self._give_up(error)

    def find(self, key: bytes) -> bytes | None:
        """The values of a key of 16 bytes; None if there are none, or they are damaged."""
        if self._handle is None or key not in self._places:
            return None
        at, size = self._places[key]
        try:
            values = os.pread(self._handle, size, at)
            check = os.pread(self._handle, 16, at - 16)
        except OSError:
            return None
        return values if len(values) == size and check == self._check(key, values) else None

    def append(self, key: bytes, values: bytes) -> None:
        """Store the values of a key of 16 bytes."""
        if self._handle is None:
            return
        record = memoryview(_RECORD.pack(len(values), key, self._check(key, values)) + values)
        try:
            while record:
                count = os.pwrite(self._handle, record, self._end)
                record, self._end = record[count:], self._end + count
            self._places[key] = self._end - len(values), len(values)
        except OSError as error:
            self._give_up(error)

    def remove(self) -> None:
        """Delete the journal, because the computation is finished or the journal unusable."""
        if self._handle is not None:
            with suppress(OSError):
                os.unlink(self._path)
            self.close()

    def close(self) -> None:
        """Unlock the journal for another run; an empty one is deleted."""
        if self._handle is not None:
            if not self._places:
                with suppress(OSError):
                    os.unlink(self._path)
            os.close(self._handle)
            self._handle = None

    def _read(self, handle: int) -> None:
        """Index the records; delete those of another computation, and an incomplete last one."""
        head = _MAGIC + self._identity + b"\n"
        size = os.fstat(handle).st_size
        if os.pread(handle, len(head), 0) != head:
            os.ftruncate(handle, 0)
            os.pwrite(handle, head, 0)
            size = len(head)
        self._end = len(head)
        while True:
            record = os.pread(handle, _RECORD.size, self._end)
            if len(record) < _RECORD.size:
                break
            count, key, _ = _RECORD.unpack(record)
            at = self._end + _RECORD.size
            if count > size - at:
                break
            self._places[key] = at, count
            self._end = at + count
        os.ftruncate(handle, self._end)

    def _check(self, key: bytes, values: bytes) -> bytes:
        digest = hashlib.blake2b(self._identity + key, digest_size=16)
        digest.update(values)
        return digest.digest()

    def _give_up(self, error: OSError) -> None:
        self.refusal = error.strerror or str(error)
        self.remove()


def place(output: Path, content: str) -> Path:
    """The path of a computation's journal: a hidden file in its output's folder, named by both."""
    return beside(output, f"{content}.{SUFFIX}")


def tidy(output: Path) -> None:
    """Remove the unlocked journals of `output`, which is complete, and abandoned ones in its folder."""
    prefix = beside(output, "").name
    try:
        journals = [each for each in os.scandir(output.parent) if _NAME.fullmatch(each.name)]
    except OSError:
        return
    for each in journals:
        with suppress(OSError):
            age = time.time() - each.stat(follow_symlinks=False).st_mtime
            if each.name.startswith(prefix) or age > ABANDONED:
                handle = claim(Path(each.path), create=False)
                if handle is not None:
                    os.unlink(each.path)
                    os.close(handle)
