"""Versions of the software that an image depends on."""

from __future__ import annotations

import platform


def versions() -> dict[str, str]:
    """Versions of Python and of the libraries that affect pixels and files, by name."""
    from importlib.metadata import version

    names = ("numpy", "embreex", "OpenImageIO", "pydantic")
    return {"python": platform.python_version(), **{name: version(name) for name in names}}
