"""``illum plan``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from illumcli.cli._options import (
    allow_option,
    gathered,
    models_option,
    no_cache_option,
    only_option,
    pattern_option,
    render_options,
    scene_argument,
    threads_option,
    variants_options,
)

if TYPE_CHECKING:
    from illumcli.commands.options import RenderOptions
    from illumcli.scene.variants import Variant


@click.command()
@scene_argument
@variants_options
@allow_option
@models_option
@pattern_option
@only_option
@threads_option
@click.option("--json", "as_json", is_flag=True, help="As JSON, a list with each camera's plan.")
@no_cache_option
@gathered("options", render_options)
def plan(scene: Path, variants: list[Variant], options: RenderOptions, as_json: bool) -> None:
    """Print what will run for SCENE, what is reused, what is skipped and why; parse no mesh, trace nothing.

    With several values, rows or frames: the plan of the first variant, and what all of them take. Files are
    hashed to know what is reused; with --no-cache only headers of images are read. Exit status: 4 where the
    memory that is free cannot hold the scene, which the plan shows.

    \b
    Examples:
      illum plan scenes/teapot.yaml
      illum plan scenes/teapot.yaml --only depth --json
      illum plan scenes/teapot.yaml -D ambient=0:1:11 -D materials.glaze.exponent=10:160:5log
    """
    import json

    from illumcli.commands.plan import ScenePlan
    from illumcli.commands.plan_table import plan_table

    planned = ScenePlan(scene, variants, options)
    parts = planned.parts()
    click.echo(json.dumps(parts, indent=1) if as_json else plan_table(parts))
    planned.refuse_too_large()
