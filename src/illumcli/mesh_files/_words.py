"""A line of a text file as text."""

from __future__ import annotations

import re


def decoded(line: bytes) -> str:
    """A line as text: UTF-8, otherwise Latin-1."""
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def without_comment(text: str) -> str:
    """`text` up to a # that begins a word."""
    return re.split(r"(?:^|(?<=\s))#", text, maxsplit=1)[0]
