"""Validate scenes: every problem of every file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from illumcli.errors import InputError
from illumcli.scene.load import file_problems, load


def run(paths: Sequence[Path], overrides: Sequence[str] = ()) -> tuple[list[Path], list[str]]:
    """The scenes that are valid and whose files are there, and the problems of the others, one line each."""
    valid: list[Path] = []
    problems: list[str] = []
    for path in paths:
        try:
            found = file_problems(load(path, overrides))
        except InputError as error:
            found = list(error.problems)
        problems += found
        if not found:
            valid.append(path)
    return valid, list(dict.fromkeys(problems))
