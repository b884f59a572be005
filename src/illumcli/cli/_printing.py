"""Lines that several commands print beside their results."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import click


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
