"""Files known by what is in them, never by their dates."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import field
from functools import cached_property
from pathlib import Path

from illumcli.errors import InputError
from illumcli.records import Value


def _alone(path: Path) -> Iterable[Path]:
    return ()


class FileFingerprint(Value):
    """The content of a file and of those beside it that it names; equal contents have equal `repr`.

    It is read when it is asked for.
    """

    locate: Callable[[], Path]
    """Finds the file; an error of its is raised when the content is asked for."""
    beside: Callable[[Path], Iterable[Path]] = field(default=_alone)
    """The files that `path` names, whether they are there or not."""

    @cached_property
    def path(self) -> Path:
        """Where the file is."""
        return self.locate()

    @cached_property
    def digest(self) -> str:
        """32 hexadecimal digits."""
        own = file_digest(self.path)
        others = [
            (path.name, file_digest(path) if path.is_file() else None) for path in self.beside(self.path)
        ]
        return hashlib.blake2b(repr((own, others)).encode(), digest_size=16).hexdigest() if others else own

    @property
    def has_changed(self) -> bool:
        """Is the content other than when it was asked for first? Not where it never was."""
        return "digest" in vars(self) and FileFingerprint(self.locate, self.beside).digest != self.digest

    def __repr__(self) -> str:
        return f"Content({self.digest})"


def file_digest(path: Path) -> str:
    """BLAKE2b-128 of a file, 32 hexadecimal digits.

    Raises
    ------
    InputError
        A file that cannot be read.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, lambda: hashlib.blake2b(digest_size=16)).hexdigest()
    except OSError as error:
        raise InputError(f"{path}: {(error.strerror or str(error)).lower()}; check the path") from error
