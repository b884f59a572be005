"""Lines that several commands print beside their results."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import click

from illumcli.errors import IllumError


def say(text: str) -> None:
    """Print a line that is not a result, on stderr."""
    click.echo(text, err=True)


def print_paths(paths: Iterable[Path]) -> None:
    """Print the files of a command, which are its result."""
    for path in paths:
        click.echo(path)


def say_kept(paths: Iterable[Path | str | None]) -> None:
    """Print the files that existed already with the same content."""
    for path in paths:
        say(f"{path}: kept, its content is the same")


class Results:
    """What a command prints on stdout: the paths of files as they are written, or a JSON list at its end.

    The list has an entry for each piece of work, also if others failed.
    """

    def __init__(self, as_json: bool) -> None:
        self._as_json = as_json
        self._entries: list[dict[str, Any]] = []

    def add(self, paths: Iterable[Path], about: Callable[[], Mapping[str, Any]]) -> None:
        """A piece of work that is done; `about` is called for JSON."""
        if self._as_json:
            self._entries.append({"files": [str(path) for path in paths], **about()})
        else:
            print_paths(paths)

    def fail(self, text: str, about: Mapping[str, Any] | None = None) -> None:
        """A piece of work that failed."""
        say(text)
        self._entries.append({**(about or {}), "error": text})

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not self._as_json or not (error is None or isinstance(error, IllumError)):
            return
        import json

        if error is not None and not any(isinstance(each.get("error"), str) for each in self._entries):
            self._entries.append({"error": str(error)})
        click.echo(json.dumps(self._entries, indent=1))


def run_batch(results: Results, do: Callable[[], list[Path] | str], quiet: bool) -> None:
    """Do several pieces of work, and print their results and what is known at the end.

    Parameters
    ----------
    do : callable
        Returns lines about a shard; otherwise the files about all pieces that are kept.
    """
    with results:
        ending = do()
    if quiet:
        return
    if isinstance(ending, str):
        say(ending)
    else:
        say_kept(ending)
