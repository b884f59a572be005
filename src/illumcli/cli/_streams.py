"""The standard streams as they may be: closed, full, or read by nobody any more. None of it stops a run."""

from __future__ import annotations

import codecs
import errno
import io
import os
import sys
from typing import TextIO


class StandardStream(io.TextIOWrapper):
    """A standard stream that is discarded from the first write on that the system refuses.

    `fault` is that refusal. A reader that left (`illum schema | head -1`) has what it wanted: that is none.
    """

    def __init__(self, number: int, before: TextIO | None, errors: str) -> None:
        encoding = getattr(before, "encoding", None) or "utf-8"
        super().__init__(
            io.BufferedWriter(io.FileIO(number, "w", closefd=False)),
            # names of files may hold any character
            encoding="utf-8" if codecs.lookup(encoding).name == "ascii" else encoding,
            errors=getattr(before, "errors", None) or errors,
            line_buffering=getattr(before, "line_buffering", False),
        )
        self.fault: OSError | None = None
        self._is_discarded = False

    def write(self, text: str) -> int:
        if not self._is_discarded:
            try:
                return super().write(text)
            except OSError as error:
                self._discard(error)
        return len(text)

    def flush(self) -> None:
        if not self._is_discarded:
            try:
                super().flush()
            except OSError as error:
                self._discard(error)

    def _discard(self, error: OSError) -> None:
        self._is_discarded = True
        self.fault = None if error.errno == errno.EPIPE else error


def open_standard_streams() -> StandardStream:
    """Make stdin, stdout and stderr usable whatever they are; stdout."""
    # a closed one is the null device: else the next file to be opened takes its number, and what libraries
    # print goes into that file
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    sys.stdout = output = StandardStream(1, sys.stdout, "strict")
    sys.stderr = StandardStream(2, sys.stderr, "backslashreplace")
    return output
