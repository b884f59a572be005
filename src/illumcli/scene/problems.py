"""Problems of a scene as lines: each once, ordered by file, line and override."""

from __future__ import annotations

from collections.abc import Sequence

from illumcli.scene.source import Path, Place, Problem


def problem_at(place: Place, path: Path, fact: str) -> Problem:
    """A problem; if its place is an override, without the steps of `path` that the override shows already."""
    if place.source.startswith("-D "):
        path = path[place.source.partition("=")[0].count(".") + 1 :]
    return Problem(place, path, fact)


def problem_lines(problems: Sequence[Problem], overrides: Sequence[str] = ()) -> list[str]:
    """One line for each distinct problem: files in the order of reading, by line, then overrides in order."""
    read = [problem.place.source for problem in problems if problem.place.line]
    sources = list(dict.fromkeys([*read, *(f"-D {text}" for text in overrides)]))

    def order(problem: Problem) -> tuple[int, int, int]:
        name, line, column = problem.place
        return sources.index(name) if name in sources else -1, line, column

    return list(dict.fromkeys(str(problem) for problem in sorted(problems, key=order)))
