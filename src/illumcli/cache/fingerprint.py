"""Fingerprints of values and files: equal text for equal content, in every process.

`fingerprint` writes a value as text, `digest` hashes it. A class may have its own method `fingerprint()`, as
`FileFingerprint` does, which identifies a file by its content, not by its path or date.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import field, fields
from functools import cache, cached_property, partial
from inspect import ismethod
from pathlib import Path
from types import FunctionType
from typing import cast

from illumcli.errors import InputError
from illumcli.graph import short_name
from illumcli.records import Value
from illumcli.schema.foreign import source_digest

PLAIN = frozenset((str, int, float, bool, bytes, type(None)))
"""Types of most values, told without a search of their ancestors."""


@cache
def shown_fields(kind: type) -> list[str]:
    """Names of the fields of a class that the `repr` of its values shows."""
    return [part.name for part in fields(kind) if part.repr]


@cache
def is_description(kind: type) -> bool:
    """True for classes of this package whose values list their fields and have no `fingerprint`."""
    others = str, int, float, bytes, tuple, list, Mapping, type, Value
    is_listing = issubclass(kind, Iterable) and not issubclass(kind, others)
    return is_listing and kind.__module__.startswith("illumcli.") and not hasattr(kind, "fingerprint")


def fingerprint(value: object) -> str:
    """Text that is equal for equal values, in every process, and differs for different values.

    It has the short name of a function and the values bound to it, the fields of a record that its `repr`
    shows, and all fields of a description.

    Raises
    ------
    TypeError
        A value without a fingerprint: an array, an arbitrary object.
    """
    kind = type(value)
    if kind in PLAIN or isinstance(value, (str, int, float, bytes)):
        return repr(value)
    if is_description(kind):  # type: ignore[arg-type]  # mypy takes the hash of its values
        return kind.__name__ + fingerprint(dict(cast("Iterable[tuple[str, object]]", value)))
    if isinstance(value, (tuple, list)):
        return f"({', '.join(_each(value))})"
    if isinstance(value, Mapping):
        parts = zip(_each(value), _each(value.values()), strict=True)
        return f"{{{', '.join([f'{key}: {each}' for key, each in parts])}}}"
    if isinstance(value, (type, FunctionType)):
        return short_name(value)
    if isinstance(value, partial):
        return fingerprint((value.func, value.args, sorted(value.keywords.items())))
    if ismethod(value):
        return fingerprint((value.__func__, value.__self__))
    if (method := getattr(value, "fingerprint", None)) is not None:
        return str(method())
    if isinstance(value, Value):
        named = {name: getattr(value, name) for name in shown_fields(kind)}  # type: ignore[arg-type]
    elif isinstance(value, Iterable) and (sources := source_digest(type(value))):
        named = {"sources of its class": sources, **dict(value)}
    else:
        raise TypeError(f"{type(value).__name__} has no fingerprint")
    return type(value).__name__ + fingerprint(named)


def _each(values: Iterable[object]) -> list[str]:
    """The fingerprint of each value; most are plain, or the object before them."""
    texts, last, text = [], None, ""
    for value in values:
        if type(value) in PLAIN:
            texts.append(repr(value))
            continue
        if value is not last:
            last, text = value, fingerprint(value)
        texts.append(text)
    return texts


def digest(value: object) -> str:
    """Hash of the fingerprint of a value, 32 hexadecimal digits."""
    return hashlib.blake2b(fingerprint(value).encode(), digest_size=16).hexdigest()


def _none(path: Path) -> Iterable[Path]:
    return ()


class FileFingerprint(Value):
    """The content of a file and of the files beside it that it names, read when first needed."""

    locate: Callable[[], Path]
    """Returns the path; its errors are raised when the content is needed."""
    beside: Callable[[Path], Iterable[Path]] = field(default=_none)
    """The files that the file at a path names, whether they exist or not."""

    def fingerprint(self) -> str:
        """Text that identifies the content.

        Raises
        ------
        InputError
            A file that cannot be read.
        """
        return f"Content({self.digest})"

    @cached_property
    def path(self) -> Path:
        """The path of the file."""
        return self.locate()

    @cached_property
    def digest(self) -> str:
        """Hash of the content, 32 hexadecimal digits."""
        content = file_digest(self.path)
        others = [
            (path.name, file_digest(path) if path.is_file() else None) for path in self.beside(self.path)
        ]
        return digest((content, others)) if others else content

    @property
    def has_changed(self) -> bool:
        """True if the content has changed since it was first needed; False if it never was."""
        return "digest" in vars(self) and FileFingerprint(self.locate, self.beside).digest != self.digest


class FileFingerprints:
    """The fingerprints of a scene's files by path. Variants of a sweep share them: each file is read once for
    all of them, and none sees another content than the first."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, Callable[[Path], Iterable[Path]]], FileFingerprint] = {}

    @property
    def count(self) -> int:
        """Number of the files so far."""
        return len(self._known)

    def paths(self) -> Iterator[Path]:
        """The paths of all files so far, and of those that they name."""
        for each in self._known.values():
            with suppress(InputError):
                yield each.path
                yield from each.beside(each.path)

    def of(
        self, path: str, locate: Callable[[str], Path], beside: Callable[[Path], Iterable[Path]] = _none
    ) -> FileFingerprint:
        """The fingerprint of the file that the scene means by `path`."""
        if (path, beside) not in self._known:
            self._known[path, beside] = FileFingerprint(partial(locate, path), beside)
        return self._known[path, beside]


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
