"""Problems of a scene as lines: each once, ordered by file, line and override."""

from __future__ import annotations

import pathlib
import re
from collections.abc import Sequence

from illumcli.mesh_files import is_mesh_file
from illumcli.scene.source import Path, Place, Problem


def problem_at(place: Place, path: Path, fact: str) -> Problem:
    """A problem; if its place is an override, without the steps of `path` that the override shows already; if
    it is a mesh file given instead of a scene, without the path that its name has in the studio scene."""
    if place.source.startswith("-D "):
        path = path[place.source.partition("=")[0].count(".") + 1 :]
    elif is_mesh_file(pathlib.Path(place.source)):
        path = ()
    return Problem(place, path, fact)


def problem_lines(problems: Sequence[Problem], overrides: Sequence[str] = ()) -> list[str]:
    """One line for each distinct problem: files in the order of reading, by line, then overrides in order."""
    read = [problem.place.source for problem in problems if problem.place.line]
    sources = list(dict.fromkeys([*read, *(f"-D {text}" for text in overrides)]))

    def order(problem: Problem) -> tuple[int, int, int]:
        name, line, column = problem.place
        return sources.index(name) if name in sources else -1, line, column

    return list(dict.fromkeys(str(problem) for problem in sorted(problems, key=order)))


def without_frame(text: str) -> str:
    """A fault without frame, place and value: the same for a value that has it at several frames."""
    return _OF_FRAME.sub("", text)


_OF_FRAME = re.compile(r"\bframe \d+|:\d+:\d+:(?= )|\bis [-+.\de]+")


def without_value(text: str) -> str:
    """The same, without the value of an override, which may vary too."""
    return re.sub(r"(-D [^=]*=).*?: (?:[\w.-]+: )?(?:at : )?", r"\1", without_frame(text))


def at_all_frames(lines: Sequence[str]) -> list[str]:
    """Faults of several frames, in order; one that several frames have stands there once, and names them."""
    groups: dict[str, list[str]] = {}
    for line in lines:
        groups.setdefault(without_value(line), []).append(line)
    joined = []
    for first, *others in groups.values():
        frames = [match for line in (first, *others) for match in re.findall(r": at frame (\d+): ", line)]
        if others and frames:
            frames_text = f": at {len(frames)} frames from {frames[0]} to {frames[-1]}: "
            joined.append(re.sub(r": at frame \d+: ", frames_text, first, count=1))
        else:
            joined.append(first)
    return joined
