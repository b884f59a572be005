"""What a report shows: an entry for every variant, scene or frame, with its pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from pathlib import Path

from illumcli.cache.fingerprint import digest
from illumcli.records import Value

PAGE = "index.html"
"""Name of the page in the folder of a report."""
PICTURE_FORMAT = 1
"""Raised when the files of a picture are made otherwise, so that they get other names."""


class Picture(Value):
    """A picture on disk."""

    path: Path
    content: str
    """Hash of everything that its pixels depend on."""
    exposure: float
    """Of linear light on the screen [stops]; a PNG was exposed by it already."""

    @property
    def identity(self) -> str:
        """The name of its files in the report: equal names mean equal files."""
        return digest((PICTURE_FORMAT, self.content, self.exposure))


class Entry(Value):
    """A variant, a scene or a frame."""

    label: str
    values: Mapping[str, str]
    """Path -> value or its name."""
    content: str
    state: str
    """`rendered`, `kept` or `failed`."""
    command: str
    """The command that makes its pictures."""
    error: str | None = None
    """The message of one that failed."""
    measures: Mapping[str, float] = field(default_factory=dict)
    """Name -> number, such as seconds and rays."""
    pictures: Mapping[str, Picture] = field(default_factory=dict)
    """Camera and layer -> picture."""
    reference: Picture | None = None
    """The picture that the errors among its measures are relative to."""

    @property
    def files(self) -> tuple[Picture, ...]:
        """Its pictures and its reference."""
        return (*self.pictures.values(), *((self.reference,) if self.reference else ()))


class Contents(Value):
    """Everything that a report says."""

    title: str
    entries: tuple[Entry, ...]
    seconds: float
    """Duration of the whole run."""
    ratio: float
    """Height of thumbnails over their width."""
    noun: str = "variant"
    """What the page calls an entry; its plural has an s."""
