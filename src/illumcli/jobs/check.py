"""Validate scenes: every problem of every file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from illumcli.errors import InputError
from illumcli.scene.load import file_problems, load, unused_lines


def run(paths: Sequence[Path], overrides: Sequence[str] = ()) -> tuple[list[Path], list[str], list[str]]:
    """The scenes that are valid and whose files are there, what these say without effect, and the problems of
    the others, one line each."""
    valid: list[Path] = []
    unused: list[str] = []
    problems: list[str] = []
    for path in paths:
        try:
            loaded = load(path, overrides)
            found = file_problems(loaded)
            outputs = loaded.scene.outputs
            unused += unused_lines(loaded, loaded.scene, outputs.layers, outputs.files)
        except InputError as error:
            found = list(error.problems)
        problems += found
        if not found:
            valid.append(path)
    return valid, list(dict.fromkeys(unused)), list(dict.fromkeys(problems))
