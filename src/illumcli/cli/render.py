"""``illum render``."""

from __future__ import annotations

from pathlib import Path

import click

from illumcli.cli._options import (
    no_cache_option,
    overrides_option,
    scenes_argument,
    strict_option,
    studio_options,
)


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
    "--report", type=click.Path(dir_okay=False, path_type=Path), help="Write what happened, as JSON."
)
@click.option("--force", is_flag=True, help="Replace files that differ.")
@strict_option
@no_cache_option
@click.option("-q", "--quiet", is_flag=True, help="No progress.")
@click.option(
    "-v", "--verbose", is_flag=True, help="Say what was skipped, repaired and kept, and where time went."
)
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
    from illumcli.jobs.render import run, write_report
    from illumcli.jobs.repairs import told

    reports = []
    for scene in scenes:
        choice = None
        if target_error is not None:
            from illumcli.jobs.target import chosen

            choice = chosen(scene, target_error, overrides, only, seed, threads)
        counts = choice.overrides if choice else ()
        paths, done = run(
            scene, (*overrides, *counts), pattern, only, seed, threads, force, reporter(quiet), cache, strict
        )
        if choice is not None:
            done.error = choice.as_data()
            if not quiet:
                reached = f"for an error of {target_error:g}; reached {done.error['reached']:.3g}"
                click.echo(f"{scene}: {' '.join(counts)}, {reached}", err=True)
        reports.append(done)
        for path in paths:
            click.echo(path)
        for kept in [] if quiet else done.kept:
            click.echo(f"{kept}: kept, its content is the same", err=True)
        for line in [] if quiet else told(done.repairs, verbose):
            click.echo(f"{scene}: {line}", err=True)
        for warning in done.warnings:
            click.echo(warning, err=True)
        if verbose and done.clamped:
            fact = f"{done.clamped} values beyond 65504, the largest of half precision, are written as that"
            click.echo(f"{scene}: {fact}; outputs.colour: float keeps them", err=True)
        if verbose:
            for camera, reused in done.reused.items():
                for name, where in reused.items():
                    click.echo(f"reused {name} of {camera}: from the {where}", err=True)
            for name, why in done.skipped.items():
                click.echo(f"skipped {name}: {why}", err=True)
            for name, seconds in sorted(done.seconds.items(), key=lambda item: -item[1]):
                click.echo(f"{seconds:8.3f} s {done.rays.get(name, 0):12d} rays  {name}", err=True)
    if report is not None:
        write_report(report, reports)
