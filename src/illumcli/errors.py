"""What can go wrong, as one family: place, fact, way out."""

from __future__ import annotations

import errno
import re
from collections.abc import Iterable


class IllumError(Exception):
    """A run that cannot go on; its text names the place, the fact and the way out.

    `exit_code` is what the command line ends with: 1 a fault of the program.
    """

    exit_code = 1


class InputError(IllumError):
    """The input is wrong: usage, scene or mesh. All problems at once, one per line."""

    exit_code = 2

    def __init__(self, problems: str | Iterable[str]) -> None:
        self.problems = (problems,) if isinstance(problems, str) else tuple(problems)
        super().__init__("\n".join(self.problems))


class ThresholdError(IllumError):
    """A comparison or a verification went beyond its tolerance."""

    exit_code = 3


class LimitError(IllumError):
    """Refused before anything was allocated: too large for the limits in force."""

    exit_code = 4


class OutputError(IllumError):
    """An output or the cache cannot be written; nothing half-written is left."""

    exit_code = 5


_SMALLER = "make the film, the meshes or the samples smaller"
LITTLE_MEMORY = f"out of memory; {_SMALLER}"

_LITTLE_MEMORY_TOO = ("start new thread", "allocate lock", "allocate read lock")
"""What Python calls RuntimeError where it has no memory."""

_NO_REASON = re.compile("error return without exception set|<.*> returned NULL without setting an exception")
"""What Python says of a function of a library that failed and gave no reason, as without memory."""


def known(error: BaseException) -> IllumError | None:
    """The same as one of ours, where its cause are the surroundings; None for a fault of the program."""
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
        case ImportError() | SyntaxError():  # most often too little memory to map a library, or to compile
            said = str(error).strip().splitlines()[-1:] or ["no reason given"]
            return LimitError(f"a library cannot be loaded: {said[0]}; free memory, or install it again")
        case RuntimeError() if any(fact in str(error) for fact in _LITTLE_MEMORY_TOO):
            return LimitError(LITTLE_MEMORY)
        case ValueError() if str(error).startswith("field '") and " is required for " in str(error):
            return LimitError(LITTLE_MEMORY)  # the compiler's tree lacks a part that got no memory
        case SystemError() if _NO_REASON.fullmatch(str(error)):
            return LimitError(f"{error}: most often for want of memory; {_SMALLER}, or report it as a fault")
    return None
