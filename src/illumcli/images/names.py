"""Paths that image libraries accept: UTF-8 only."""

from __future__ import annotations

import os

NO_UTF8 = "the path is not UTF-8, which image files need; rename the file or its folder"


def no_utf8(path: str) -> bool:
    """True if the path has bytes that are not UTF-8."""
    return any("\udc80" <= c <= "\udcff" for c in path)


def printable(path: str) -> str:
    """The path with bytes that are not UTF-8 as \\xNN."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")
