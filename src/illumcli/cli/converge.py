"""`illum converge`: run time against error."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from illumcli.cli._options import (
    SAMPLER,
    no_cache_option,
    overrides_option,
    quiet_option,
    scene_argument,
    studio_options,
)

if TYPE_CHECKING:
    from illumcli.accuracy.reference import Vary

_FILE = click.Path(path_type=Path)
_EPILOG = """\b
Examples:
  illum converge scenes/obscurance.yaml
  illum converge scenes/obscurance.yaml --from 8 --to 1024 --csv curve.csv -o curve.png
  illum converge scenes/teapot.yaml --vary pixels --layer beauty --sampler spiral
"""


@click.command(epilog=_EPILOG)
@scene_argument
@overrides_option
@studio_options
@click.option(
    "--vary",
    type=click.Choice(["obscurance", "pixels", "both"]),
    help="What is doubled: obscurance rays, samples per pixel, or the two in turn. By default obscurance.",
)
@click.option("--from", "first", type=click.IntRange(1, 65536), help="The fewest per pixel.")
@click.option("--to", "last", type=click.IntRange(2, 65536), help="The most per pixel.")
@click.option("--layer", metavar="NAME", help="By default obscurance, or beauty where samples vary.")
@click.option(
    "--sampler",
    "samplers",
    multiple=True,
    type=SAMPLER,
    help="Only this sampler of obscurance rays; may be repeated.",
)
@click.option("--repeats", type=click.IntRange(1, 1000), default=3, show_default=True, help="Other seeds.")
@click.option(
    "--width", type=click.IntRange(1, 65536), default=320, show_default=True, help="Of the film, at most."
)
@click.option("--camera", metavar="NAME", help="By default the first.")
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), help="By default the scene's.")
@click.option("-t", "--threads", type=click.IntRange(1, 1024), help="By default one per core.")
@click.option("--csv", "csv_file", type=_FILE, metavar="FILE.csv", help="A line per picture rendered.")
@click.option("-o", "--output", type=_FILE, metavar="FILE.png", help="The curves as .png or .svg.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")
@click.option("--force", is_flag=True, help="Replace files that differ, write those that do not anew.")
@no_cache_option
@quiet_option
def converge(
    scene: Path,
    overrides: tuple[str, ...],
    vary: Vary | None,
    first: int | None,
    last: int | None,
    layer: str | None,
    samplers: tuple[str, ...],
    repeats: int,
    width: int,
    camera: str | None,
    seed: int | None,
    threads: int | None,
    csv_file: Path | None,
    output: Path | None,
    as_json: bool,
    force: bool,
    cache: bool,
    quiet: bool,
) -> None:
    """Measure run time against error of SCENE: seconds and rays beside the RMSE to a reference.

    The reference comes from other random numbers and many more samples, in two halves whose difference states
    its own error; it is kept between runs. `random needs` is how many times as many samples plain random
    sampling takes for the same error. Seconds are those of casting and shading, without reading the scene.
    """
    import json
    import sys

    from illumcli.accuracy.convergence import ConvergenceSettings, measure_convergence
    from illumcli.accuracy.convergence_files import ConvergenceFiles
    from illumcli.accuracy.convergence_table import convergence_table, text_plot
    from illumcli.cli._progress import reporter

    settings = ConvergenceSettings(
        overrides,
        vary,
        first,
        last,
        layer,
        samplers or tuple(SAMPLER.choices),
        repeats,
        width,
        camera,
        seed,
        threads,
        cache,
    )
    files = ConvergenceFiles(csv_file, output, force)
    result = measure_convergence(scene, settings, reporter(quiet), files.look)
    files.write(result)
    for kept in files.kept if not quiet else []:
        click.echo(f"{kept}: kept, its content is the same", err=True)
    if as_json:
        click.echo(json.dumps(result.as_data(), indent=2))
        return
    click.echo(convergence_table(result))
    if sys.stdout.isatty():
        click.echo(text_plot(result.curves))
