"""Lines about a scene: each problem once, in the order in which a reader finds them."""

from __future__ import annotations

from collections.abc import Sequence

from illumcli.scene.source import Path, Place, Problem


def problem_at(place: Place, path: Path, fact: str) -> Problem:
    """A problem with the part of `path` that its place does not say already: an override names its own."""
    if place.source.startswith("-D "):
        path = path[place.source.partition("=")[0].count(".") + 1 :]
    return Problem(place, path, fact)


def problem_lines(problems: Sequence[Problem], overrides: Sequence[str] = ()) -> list[str]:
    """One line each, once: files as they were read, by line; then the overrides as they were given."""
    read = [problem.place.source for problem in problems if problem.place.line]
    sources = list(dict.fromkeys([*read, *(f"-D {text}" for text in overrides)]))

    def order(problem: Problem) -> tuple[int, int, int]:
        name, line, column = problem.place
        return sources.index(name) if name in sources else -1, line, column

    return list(dict.fromkeys(str(problem) for problem in sorted(problems, key=order)))
