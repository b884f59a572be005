"""``illum check``."""

from __future__ import annotations

from pathlib import Path

import click

from illumcli.cli._options import frames_option, overrides_option, scenes_argument, studio_options
from illumcli.cli._printing import say


@click.command()
@scenes_argument
@overrides_option
@studio_options
@frames_option
def check(scenes: tuple[Path, ...], overrides: tuple[str, ...], frames: str | None) -> None:
    """Validate each SCENE at all its frames and print every problem at once.

    Nothing is rendered, and no mesh is read.
    """
    from illumcli.commands.check import check_scenes
    from illumcli.errors import InputError

    checks = check_scenes(scenes, overrides, frames)
    for line in checks.unused:
        say(line)
    for path in checks.valid:
        click.echo(f"{path}: ok")
    if checks.problems:
        raise InputError(checks.problems)
