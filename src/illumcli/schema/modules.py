"""Modules of a folder, without importing them."""

from __future__ import annotations

import os
from collections.abc import Iterable


def modules(folders: Iterable[str]) -> tuple[str, ...]:
    """The names of the modules and packages in folders, sorted, without those that begin with an underscore.

    Unlike `pkgutil`, which takes a folder that cannot be listed for an empty one, this raises.

    Raises
    ------
    OSError
        A folder cannot be listed.
    """
    names = {
        entry.name.partition(".")[0]
        for folder in folders
        for entry in os.scandir(folder)
        if entry.name.endswith(".py") or entry.is_dir()
    }
    return tuple(sorted(name for name in names if not name.startswith("_")))
