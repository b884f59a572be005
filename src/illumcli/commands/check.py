"""Validate scenes: every problem of every file, and what no render would begin with."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from illumcli.commands.render import prepared, refuse_too_large
from illumcli.errors import InputError, LimitError
from illumcli.scene.load import file_problems, load, unused_lines


def run(paths: Sequence[Path], overrides: Sequence[str] = ()) -> tuple[list[Path], list[str], list[str]]:
    """The scenes that are valid and whose files are there, what these say without effect, and the problems of
    the others, one line each.

    Raises
    ------
    LimitError
        Scenes that are valid and too large, where no scene has a problem.
    """
    valid: list[Path] = []
    unused: list[str] = []
    problems: list[str] = []
    too_large: list[str] = []
    for path in paths:
        try:
            loaded = load(path, overrides)
            found = file_problems(loaded)
            if not found:
                work = prepared(loaded)
                refuse_too_large(work, work.targets)
            outputs = loaded.scene.outputs
            unused += unused_lines(loaded, loaded.scene, outputs.layers, outputs.files)
        except InputError as error:
            found = list(error.problems)
        except LimitError as error:
            too_large.append(str(error) if str(path) in str(error) else f"{path}: {error}")
            continue
        problems += found
        if not found:
            valid.append(path)
    if too_large and not problems:
        raise LimitError("\n".join(dict.fromkeys(too_large)))
    problems += too_large
    return valid, list(dict.fromkeys(unused)), list(dict.fromkeys(problems))
