"""Versions of the software that an image depends on."""

from __future__ import annotations

import platform
from functools import cache


def versions() -> dict[str, str]:
    """Versions of Python and of the libraries that affect pixels and files, by name."""
    names = ("numpy", "embreex", "OpenImageIO", "pydantic")
    return {"python": platform.python_version(), **{name: _version(name) for name in names}}


@cache
def _version(name: str) -> str:
    """The version of a library, whose files are searched once per process."""
    from importlib.metadata import version

    return version(name)
