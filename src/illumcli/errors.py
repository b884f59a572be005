"""Errors of one family: their texts name the place, the fact and the remedy."""

from __future__ import annotations

import errno
import re
from collections.abc import Callable, Iterable
from typing import TypeVar

R = TypeVar("R")


class IllumError(Exception):
    """A run cannot continue; the text names the place, the fact and the remedy.

    `exit_code` is the exit code of the command line; 1 means a fault of the program.
    """

    exit_code = 1


class InputError(IllumError):
    """The input is wrong: usage, scene or mesh. All problems at once, one per line."""

    exit_code = 2

    def __init__(self, problems: str | Iterable[str]) -> None:
        self.problems = (problems,) if isinstance(problems, str) else tuple(problems)
        super().__init__("\n".join(self.problems))


class ThresholdError(IllumError):
    """A comparison or verification exceeds its tolerance."""

    exit_code = 3


class LimitError(IllumError):
    """Too large for memory, disk or other limits; refused before anything is allocated."""

    exit_code = 4


class OutputError(IllumError):
    """An output or the cache cannot be written; no incomplete file remains."""

    exit_code = 5


_SMALLER = "make the film, the meshes or the samples smaller"
LITTLE_MEMORY = f"out of memory; {_SMALLER}"

_LITTLE_MEMORY_TOO = ("start new thread", "allocate lock", "allocate read lock")
"""Texts of the RuntimeErrors that Python raises if memory is short."""

_NO_REASON = re.compile("error return without exception set|<.*> returned NULL without setting an exception")
"""Text of the SystemError about a library function that failed without a reason, often for lack of memory."""


def known(error: BaseException) -> IllumError | None:
    """The error as an IllumError if the environment caused it; None for a fault of the program."""
    match error:
        case IllumError():
            return error
        case MemoryError() | OSError(errno=errno.ENOMEM):
            return LimitError(LITTLE_MEMORY)
        case OSError():
            place = f"{error.filename}: " if error.filename else ""
            fact = f"{place}{error.strerror or error}"
            if error.errno in (errno.EMFILE, errno.ENFILE):
                return LimitError(f"{fact}; raise the limit on open files (ulimit -n)")
            return OutputError(f"{fact}; check the disk and the permissions")
        case (
            ImportError() | SyntaxError()
        ):  # usually there is too little memory to map a library or to compile
            reason = str(error).strip().splitlines()[-1:] or ["no reason given"]
            return LimitError(f"a library cannot be loaded: {reason[0]}; free memory, or install it again")
        case RuntimeError() if any(fact in str(error) for fact in _LITTLE_MEMORY_TOO):
            return LimitError(LITTLE_MEMORY)
        case ValueError() if str(error).startswith("field '") and " is required for " in str(error):
            return LimitError(LITTLE_MEMORY)  # a node of the compiler's tree could not be allocated
        case SystemError() if _NO_REASON.fullmatch(str(error)):
            return LimitError(f"{error}: most often for want of memory; {_SMALLER}, or report it as a fault")
    return None


def unless_faulty(prepare: Callable[[], R]) -> R | None:
    """The result of a function; None for a known error, which is reported when its unit has its turn."""
    try:
        return prepare()
    except Exception as error:
        if known(error) is None:
            raise
        return None
