"""The protocol of objects that have a path."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol


class Located(Protocol):
    """Anything with a path, such as the cache's fingerprint of a file."""

    @property
    def path(self) -> Path: ...
