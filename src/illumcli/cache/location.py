"""Where the store is, and how large it may be: the environment decides."""

from __future__ import annotations

import os
from pathlib import Path

from illumcli.cache.store import LIMIT, Store
from illumcli.errors import InputError

_UNITS = {"": 1, "K": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}


def open_store() -> Store | None:
    """The store of the environment's folder and limit; None for a user without a home folder.

    Raises
    ------
    InputError
        ILLUM_CACHE_SIZE is no size.
    """
    folder = default_folder()
    try:
        return Store(folder, default_limit()) if folder is not None else None
    except ValueError as error:
        raise InputError(f"ILLUM_CACHE_SIZE: {error}; write it as 500M or 4G") from None


def default_folder() -> Path | None:
    """The folder of entries: ILLUM_CACHE, else `illum` in the user's cache folder (XDG_CACHE_HOME).

    None for a user without a home folder.
    """
    if folder := os.environ.get("ILLUM_CACHE"):
        return Path(folder)
    base = os.environ.get("XDG_CACHE_HOME", "")
    if not os.path.isabs(base):
        base = os.path.join(os.environ.get("HOME", os.path.expanduser("~")), ".cache")
    return Path(base) / "illum" if os.path.isabs(base) else None


def default_limit() -> int:
    """The limit that ILLUM_CACHE_SIZE sets, by default `LIMIT` [bytes]."""
    return size_of(os.environ["ILLUM_CACHE_SIZE"]) if os.environ.get("ILLUM_CACHE_SIZE") else LIMIT


def size_of(text: str) -> int:
    """The number of bytes in a text such as `500M` or `4G`.

    Raises
    ------
    ValueError
    """
    number = text.strip().upper().removesuffix("B").removesuffix("I")
    unit = number[-1:] if number[-1:] in _UNITS else ""
    size = float(number.removesuffix(unit)) * _UNITS[unit]
    if not 0 <= size < 2**60:
        raise ValueError(f"no size: {text}")
    return int(size)
