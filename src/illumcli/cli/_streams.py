"""Standard streams that may be closed, full, or without a reader; a run continues all the same."""

from __future__ import annotations

import codecs
import errno
import io
import os
import re
import sys
from typing import TextIO

_NOT_TEXT = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")
"""Characters that control terminals, except tabs and line ends, or change the writing direction."""


def cleaned(text: str) -> str:
    """`text` with characters that control terminals written as `\\x1b`: names may hold any."""
    return _NOT_TEXT.sub(lambda match: ascii(match[0])[1:-1], text)


class StandardStream(io.TextIOWrapper):
    """A standard stream whose output is discarded once the system refuses a write.

    `fault` is its error; it is no fault if the reader has closed the pipe (`illum schema | head -1`). `write`
    escapes control characters, which names in files may contain; `write_raw` does not.
    """

    def __init__(self, number: int, before: TextIO | None, errors: str) -> None:
        encoding = getattr(before, "encoding", None) or "utf-8"
        super().__init__(
            io.BufferedWriter(io.FileIO(number, "w", closefd=False)),
            # names of files may contain any character
            encoding="utf-8" if codecs.lookup(encoding).name == "ascii" else encoding,
            errors=errors,
            line_buffering=getattr(before, "line_buffering", False),
        )
        self.fault: OSError | None = None
        self._is_discarded = False

    def write(self, text: str) -> int:
        self.write_raw(cleaned(text))
        return len(text)

    def write_raw(self, text: str) -> None:
        """Write `text` without escaping control characters."""
        if not self._is_discarded:
            try:
                super().write(text)
            except OSError as error:
                self._discard(error)

    def flush(self) -> None:
        if not self._is_discarded:
            try:
                super().flush()
            except OSError as error:
                self._discard(error)

    def _discard(self, error: OSError) -> None:
        self._is_discarded = True
        self.fault = None if error.errno == errno.EPIPE else error


def _as_bytes(error: UnicodeError) -> tuple[bytes, int]:
    """What an encoding lacks: bytes of paths as they are, characters as `\\xNN`."""
    assert isinstance(error, UnicodeEncodeError)
    lacking = error.object[error.start : error.end]
    paths = ("surrogateescape" if "\udc80" <= c <= "\udcff" else "backslashreplace" for c in lacking)
    return b"".join(c.encode("ascii", how) for c, how in zip(lacking, paths, strict=True)), error.end


def open_standard_streams() -> StandardStream:
    """Make stdin, stdout and stderr usable in any state; returns stdout."""
    # Replace closed streams by the null device: otherwise the next file to be opened would get their number,
    # and receive what libraries print.
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    codecs.register_error("illum.path", _as_bytes)
    sys.stdout = output = StandardStream(1, sys.stdout, "illum.path")
    sys.stderr = StandardStream(2, sys.stderr, "backslashreplace")
    return output
