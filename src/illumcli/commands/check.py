"""Validate scenes: every problem of every file, and all that would prevent a render from starting."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from illumcli.commands.options import RenderJob, RenderOptions
from illumcli.commands.render_jobs import RenderJobs
from illumcli.commands.work import refuse_too_large, work_of
from illumcli.errors import InputError, LimitError
from illumcli.records import Value
from illumcli.scene.access import file_problems
from illumcli.scene.load import load
from illumcli.scene.problems import at_all_frames
from illumcli.scene.scene_file import unused_lines


class SceneChecks(Value):
    """Valid scenes, and the problems of the others."""

    valid: list[Path]
    """Scenes without a problem, whose files exist."""
    unused: list[str]
    """A line for every value that has no effect."""
    problems: list[str]
    """A line for every problem."""


def check_scenes(
    paths: Sequence[Path], overrides: Sequence[str] = (), frames: str | None = None
) -> SceneChecks:
    """Every problem of the scenes at all of their frames; nothing is rendered and no mesh is read.

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
        of_scene: list[str] = []
        of_frames: list[list[str]] = []
        is_large = False
        jobs = RenderJobs([path], RenderOptions(tuple(overrides), frames=frames))
        for job in jobs:
            try:
                of_frames.append(_checked(jobs, job, of_scene))
            except InputError as error:
                of_scene += error.problems
            except LimitError as error:
                is_large = True
                too_large.append(str(error) if str(path) in str(error) else f"{path}: {error}")
        problems += at_all_frames(of_scene)
        unused += (
            [line for line in of_frames[0] if all(line in each for each in of_frames)] if of_frames else []
        )
        if not of_scene and not is_large:
            valid.append(path)
    if too_large and not problems:
        raise LimitError("\n".join(dict.fromkeys(too_large)))
    problems += too_large
    return SceneChecks(valid, list(dict.fromkeys(unused)), list(dict.fromkeys(problems)))


def _checked(jobs: RenderJobs, job: RenderJob, problems: list[str]) -> list[str]:
    """A line for every value of a scene that has no effect at a frame; adds problems of its files."""
    shared = jobs.worker.shared(job.scene)
    loaded = load(job.scene, job.options.overrides, shared.text, job.frame)
    of_files = file_problems(loaded)
    problems += of_files
    if not of_files:
        work = work_of(job, loaded, shared.files)
        refuse_too_large(work, work.targets)
    outputs = loaded.scene.outputs
    return unused_lines(loaded, loaded.scene, outputs.layers, outputs.files)
