"""``illum plan``."""

from __future__ import annotations

from pathlib import Path

import click

from illumcli.cli._options import (
    frames_option,
    no_cache_option,
    overrides_option,
    scene_argument,
    studio_options,
)


@click.command()
@scene_argument
@overrides_option
@studio_options
@click.option("--only", "only", multiple=True, metavar="LAYER", help="Plan these layers alone.")
@click.option("--json", "as_json", is_flag=True, help="As JSON, a list with each camera's plan.")
@frames_option
@no_cache_option
def plan(
    scene: Path,
    overrides: tuple[str, ...],
    only: tuple[str, ...],
    as_json: bool,
    cache: bool,
    frames: str | None,
) -> None:
    """Print what will run for SCENE, what is reused, what is skipped and why; parse no mesh, trace nothing.

    Files are hashed to know what is reused; with --no-cache only headers of images are read. Exit status: 4
    where the memory that is free cannot hold the scene, which the plan shows.

    \b
    Examples:
      illum plan scenes/teapot.yaml
      illum plan scenes/teapot.yaml --only depth --json
    """
    from illumcli.commands.plan import plan_scene, refuse_too_large

    click.echo(plan_scene(scene, overrides, only, as_json, cache, frames))
    refuse_too_large(scene, overrides, frames)
