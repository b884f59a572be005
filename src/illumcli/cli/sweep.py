"""``illum sweep``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from illumcli.cli._options import (
    allow_option,
    keep_going_option,
    no_cache_option,
    quiet_option,
    scene_argument,
    strict_option,
    studio_options,
    verbose_option,
)

if TYPE_CHECKING:
    from illumcli.commands.sweep_outcome import Outcome

_FILE = click.Path(path_type=Path)


@click.command()
@scene_argument
@click.option(
    "-D",
    "overrides",
    multiple=True,
    metavar="PATH=VALUES",
    help="Values of a path: a,b,c or START:STOP:COUNT or START:STOP:COUNTlog.",
)
@studio_options
@click.option("--zip", "together", is_flag=True, help="First values together, then second ones, ...")
@click.option("--rows", type=_FILE, metavar="FILE.csv", help="A variant per row: paths in the first line.")
@click.option(
    "--frames",
    metavar="FIRST:LAST[:STEP]",
    help="A variant per frame; a value may be a formula of frame.",
)
@click.option(
    "-o", "--output", "pattern", metavar="PATTERN", help="Name pattern of the images, .exr or .png."
)
@click.option("--only", "only", multiple=True, metavar="LAYER", help="Render these layers alone.")
@click.option("--sheet", type=_FILE, metavar="FILE.png", help="Write a contact sheet, labelled.")
@click.option("--table", type=_FILE, metavar="FILE.csv", help="Write values, seconds, rays, mean, error.")
@click.option(
    "--reference", metavar="N|FILE", help="What the table's errors are against: variant N or an image."
)
@click.option("--report", type=_FILE, metavar="FILE.json", help="Write every variant's report.")
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), help="By default the scene's.")
@click.option("-t", "--threads", type=click.IntRange(1, 1024), help="By default one per core.")
@click.option("--force", is_flag=True, help="Replace files that differ, render those that do not.")
@keep_going_option
@strict_option
@no_cache_option
@allow_option
@quiet_option
@verbose_option
def sweep(
    scene: Path,
    overrides: tuple[str, ...],
    together: bool,
    rows: Path | None,
    frames: str | None,
    pattern: str | None,
    only: tuple[str, ...],
    sheet: Path | None,
    table: Path | None,
    reference: str | None,
    report: Path | None,
    seed: int | None,
    threads: int | None,
    force: bool,
    keep_going: bool,
    strict: bool,
    cache: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Render the variants of SCENE in one process; print the path of every image.

    What no override touches is made once. A sweep that was stopped goes on where it was: images that are
    there with the same content are kept.

    \b
    Every value with every other, the last path fastest:
      illum sweep scene.yaml -D materials.clay.exponent=4:256:7log -D ambient=0.2,0.4 --sheet all.png
    A turntable: the eye on a circle, once around in 120 frames:
      illum sweep scene.yaml --frames 0:119 -D 'camera.position=[4*cos(frame*pi/60), 1, 4*sin(frame*pi/60)]'
    """
    from illumcli.cli._progress import reporter
    from illumcli.commands.render_all import Settings
    from illumcli.commands.sweep import sweep_scene
    from illumcli.commands.sweep_files import SweepFiles
    from illumcli.render_graph.repairs import repair_lines
    from illumcli.scene.variants import variants_of

    said: set[str] = set()

    def written(outcome: Outcome) -> None:
        # a fault of the scene itself is that of every variant
        if outcome.error is not None and str(outcome.error) not in said:
            said.add(str(outcome.error))
            click.echo(f"{outcome.label}: {outcome.error}", err=True)
        if outcome.report is None:
            return
        for path in outcome.paths:
            click.echo(path)
        for kept in outcome.report.kept if not quiet else []:
            click.echo(f"{kept}: kept, its content is the same", err=True)
        for line in repair_lines(outcome.report.repairs, verbose) if not quiet else []:
            if line not in said:
                click.echo(f"{scene}: {line}", err=True)
            said.add(line)

    if reference is not None and table is None:
        raise click.UsageError("--reference is what the errors of --table are against; give --table")
    variants = variants_of(overrides, together, rows, frames)
    settings = Settings(
        pattern=pattern, only=only, seed=seed, threads=threads, force=force, cache=cache, strict=strict,
        keep_going=keep_going,
    )  # fmt: skip
    files = SweepFiles(sheet, table, report, reference)
    done = sweep_scene(scene, variants, settings, files, reporter(quiet), written)
    for warning in done.warnings:
        click.echo(warning, err=True)
    for kept in done.kept if not quiet else []:
        click.echo(f"{kept}: kept, its content is the same", err=True)
