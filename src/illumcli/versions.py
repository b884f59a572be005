"""Versions of what an image depends on."""

from __future__ import annotations

import platform


def versions() -> dict[str, str]:
    """Python and the libraries that decide about pixels and files, by name."""
    from importlib.metadata import version

    names = ("numpy", "embreex", "OpenImageIO", "pydantic")
    return {"python": platform.python_version(), **{name: version(name) for name in names}}
