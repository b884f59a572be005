"""What can go wrong, as one family: place, fact, way out."""

from __future__ import annotations

from collections.abc import Iterable


class IllumError(Exception):
    """A run that cannot go on; its text names the place, the fact and the way out.

    `exit_code` is what the command line ends with: 1 failed while running.
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
