"""``illum check``."""

from __future__ import annotations

from pathlib import Path

import click

from illumcli.cli._options import overrides_option, scenes_argument, studio_options


@click.command()
@scenes_argument
@overrides_option
@studio_options
def check(scenes: tuple[Path, ...], overrides: tuple[str, ...]) -> None:
    """Validate each SCENE and say every problem at once; nothing is rendered and no mesh is read."""
    from illumcli.commands.check import run
    from illumcli.errors import InputError

    valid, unused, problems = run(scenes, overrides)
    for line in unused:
        click.echo(line, err=True)
    for path in valid:
        click.echo(f"{path}: ok")
    if problems:
        raise InputError(problems)
