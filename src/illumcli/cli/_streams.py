"""The standard streams as they may be: closed, full, or read by nobody any more. None of it stops a run."""

from __future__ import annotations

import codecs
import errno
import io
import os
import re
import sys
from typing import TextIO

_NOT_TEXT = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")
"""What terminals obey: control characters but tabs and line ends, and what turns the direction of writing."""


def cleaned(text: str) -> str:
    """`text` with every character that a terminal would obey written as `\\x1b`: names may hold any."""
    return _NOT_TEXT.sub(lambda found: ascii(found[0])[1:-1], text)


class StandardStream(io.TextIOWrapper):
    """A standard stream that is discarded from the first write on that the system refuses.

    `fault` is that refusal. A reader that left (`illum schema | head -1`) has what it wanted: that is none.
    What it is given is text, whatever a file calls its parts; `obeyed` takes what a terminal is to obey.
    """

    def __init__(self, number: int, before: TextIO | None, errors: str) -> None:
        encoding = getattr(before, "encoding", None) or "utf-8"
        super().__init__(
            io.BufferedWriter(io.FileIO(number, "w", closefd=False)),
            # names of files may hold any character
            encoding="utf-8" if codecs.lookup(encoding).name == "ascii" else encoding,
            errors=errors,
            line_buffering=getattr(before, "line_buffering", False),
        )
        self.fault: OSError | None = None
        self._is_discarded = False

    def write(self, text: str) -> int:
        self.obeyed(cleaned(text))
        return len(text)

    def obeyed(self, text: str) -> None:
        """Write `text` as it is."""
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
    """Make stdin, stdout and stderr usable whatever they are; stdout."""
    # a closed one is the null device: else the next file to be opened takes its number, and what libraries
    # print goes into that file
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    codecs.register_error("illum.path", _as_bytes)
    sys.stdout = output = StandardStream(1, sys.stdout, "illum.path")
    sys.stderr = StandardStream(2, sys.stderr, "backslashreplace")
    return output
