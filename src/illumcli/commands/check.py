"""Validate scenes: every problem of every file, and all that would prevent a render from starting."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.work import refuse_too_large, work_of
from illumcli.errors import InputError, LimitError
from illumcli.records import Value
from illumcli.scene.access import file_problems
from illumcli.scene.load import load
from illumcli.scene.scene_file import unused_lines


class SceneChecks(Value):
    """Valid scenes, and the problems of the others."""

    valid: list[Path]
    """Scenes without a problem, whose files exist."""
    unused: list[str]
    """A line for every value that has no effect."""
    problems: list[str]
    """A line for every problem."""


def check_scenes(paths: Sequence[Path], overrides: Sequence[str] = ()) -> SceneChecks:
    """Every problem of the scenes; nothing is rendered and no mesh is read.

    Raises
    ------
    LimitError
        Scenes are valid but too large, and no scene has another problem.
    """
    valid: list[Path] = []
    unused: list[str] = []
    problems: list[str] = []
    too_large: list[str] = []
    for path in paths:
        try:
            loaded = load(path, overrides)
            of_scene = file_problems(loaded)
            if not of_scene:
                work = work_of(RenderJob(path, RenderOptions(tuple(overrides))), loaded)
                refuse_too_large(work, work.targets)
            outputs = loaded.scene.outputs
            unused += unused_lines(loaded, loaded.scene, outputs.layers, outputs.files)
        except InputError as error:
            of_scene = list(error.problems)
        except LimitError as error:
            too_large.append(str(error) if str(path) in str(error) else f"{path}: {error}")
            continue
        problems += of_scene
        if not of_scene:
            valid.append(path)
    if too_large and not problems:
        raise LimitError("\n".join(dict.fromkeys(too_large)))
    problems += too_large
    return SceneChecks(valid, list(dict.fromkeys(unused)), list(dict.fromkeys(problems)))
