"""``illum render``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from illumcli.cli._options import (
    keep_going_option,
    no_cache_option,
    overrides_option,
    quiet_option,
    scenes_argument,
    strict_option,
    studio_options,
    tell,
    verbose_option,
)

if TYPE_CHECKING:
    from illumcli.commands.render_all import Rendered


@click.command()
@scenes_argument
@click.option(
    "-o", "--output", "pattern", metavar="PATTERN", help="Name pattern of the images, .exr or .png."
)
@overrides_option
@studio_options
@click.option("--only", "only", multiple=True, metavar="LAYER", help="Render these layers alone.")
@click.option(
    "--target-error",
    type=click.FloatRange(0, min_open=True),
    metavar="E",
    help="Choose samples per pixel and obscurance rays for this RMSE, by pilots on other random numbers.",
)
@click.option(
    "--seed", type=click.IntRange(0, 2**32 - 1), help="Of every random number; by default the scene's."
)
@click.option("-t", "--threads", type=click.IntRange(1, 1024), help="By default one per core.")
@click.option(
    "--report",
    type=click.Path(path_type=Path),
    metavar="FILE.json",
    help="Write what happened, as JSON.",
)
@click.option("--force", is_flag=True, help="Replace files that differ, write those that do not anew.")
@keep_going_option
@strict_option
@no_cache_option
@quiet_option
@verbose_option
def render(
    scenes: tuple[Path, ...],
    pattern: str | None,
    overrides: tuple[str, ...],
    only: tuple[str, ...],
    target_error: float | None,
    seed: int | None,
    threads: int | None,
    report: Path | None,
    force: bool,
    keep_going: bool,
    strict: bool,
    cache: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Render each SCENE, a scene file or a mesh; print the path of every image.

    \b
    A pattern may hold {scene}, {camera}, {layer}, {frame} and any overridden path:
      illum render scenes/teapot.yaml -o out/{scene}.{camera}.exr
      illum render scene.yaml -D materials.clay.sigma=0.3 -o 'clay-{materials.clay.sigma}.png'
      illum render scene.yaml --only normal --only depth -o '{scene}.{layer}.png'
    A mesh stands on a floor under two lights:
      illum render bunny.obj
    """
    from illumcli.cli._progress import reporter
    from illumcli.commands import render_all as job
    from illumcli.render_graph.repairs import repair_lines

    def written(done: Rendered) -> None:
        found = done.report
        if done.counts and not quiet:
            reached = f"for an error of {target_error:g}; reached {found.error['reached']:.3g}"
            click.echo(f"{done.scene}: {' '.join(done.counts)}, {reached}", err=True)
        for path in done.paths:
            click.echo(path)
        for kept in [] if quiet else found.kept:
            click.echo(f"{kept}: kept, its content is the same", err=True)
        for line in [] if quiet else repair_lines(found.repairs, verbose):
            click.echo(f"{done.scene}: {line}", err=True)
        for warning in found.warnings:
            click.echo(warning, err=True)
        if verbose and found.clamped:
            fact = f"{found.clamped} values beyond 65504, the largest of half precision, are written as that"
            click.echo(f"{done.scene}: {fact}; outputs.colour: float keeps them", err=True)
        if verbose:
            for camera, reused in found.reused.items():
                for name, where in reused.items():
                    click.echo(f"reused {name} of {camera}: from the {where}", err=True)
            for name, why in found.skipped.items():
                click.echo(f"skipped {name}: {why}", err=True)
            for name, seconds in sorted(found.seconds.items(), key=lambda item: -item[1]):
                click.echo(f"{seconds:8.3f} s {found.rays.get(name, 0):12d} rays  {name}", err=True)

    settings = job.Settings(
        overrides, pattern, only, seed, threads, target_error, force, cache, strict, keep_going
    )
    is_kept = job.run(scenes, settings, report, reporter(quiet), written, tell)
    if is_kept and not quiet:
        click.echo(f"{report}: kept, its content is the same", err=True)
