"""Files by where they are, whatever else is known of them."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol


class Located(Protocol):
    """Anything with a path, as the cache's fingerprint of a file has one."""

    @property
    def path(self) -> Path: ...
