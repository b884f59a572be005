"""`illum converge`: run time against error."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from illumcli.cli._options import (
    FILE,
    SAMPLER,
    force_option,
    gathered,
    json_option,
    no_cache_option,
    overrides_option,
    quiet_option,
    scene_argument,
    seed_option,
    studio_options,
    taken,
    threads_option,
)
from illumcli.cli._printing import say_kept

if TYPE_CHECKING:
    from illumcli.accuracy.convergence import ConvergenceSettings

_EPILOG = """\b
Examples:
  illum converge scenes/obscurance.yaml
  illum converge scenes/obscurance.yaml --from 8 --to 1024 --csv curve.csv -o curve.png
  illum converge scenes/teapot.yaml --vary pixels --layer beauty --sampler spiral
"""


def _settings(options: dict[str, Any]) -> ConvergenceSettings:
    from illumcli.accuracy.convergence import ConvergenceSettings

    options["samplers"] = options["samplers"] or tuple(SAMPLER.choices)
    return taken(ConvergenceSettings, options)


@click.command(epilog=_EPILOG)
@scene_argument
@overrides_option
@studio_options
@click.option(
    "--vary",
    type=click.Choice(["obscurance", "pixels", "both"]),
    help="What is varied: obscurance rays, samples per pixel, or the two in turn. By default obscurance.",
)
@click.option("--from", "first", type=click.IntRange(1, 65536), help="Least count per pixel; it is doubled.")
@click.option("--to", "last", type=click.IntRange(2, 65536), help="Greatest count per pixel.")
@click.option("--layer", metavar="NAME", help="By default obscurance, or beauty where samples vary.")
@click.option(
    "--sampler",
    "samplers",
    multiple=True,
    type=SAMPLER,
    help="Only this sampler of obscurance rays; may be repeated.",
)
@click.option(
    "--reconstruct/--no-reconstruct",
    default=True,
    help="Also with obscurance fitted to the surface, unless the scene says no.",
)
@click.option(
    "--repeats", type=click.IntRange(1, 1000), default=3, show_default=True, help="Number of seeds."
)
@click.option(
    "--width",
    type=click.IntRange(1, 65536),
    default=320,
    show_default=True,
    help="Greatest width of the film.",
)
@click.option("--camera", metavar="NAME", help="By default the first.")
@seed_option("By default the scene's.")
@threads_option
@click.option("--csv", "csv_file", type=FILE, metavar="FILE.csv", help="Write a line per image.")
@click.option("-o", "--output", type=FILE, metavar="FILE.png", help="The curves as .png or .svg.")
@json_option
@force_option()
@no_cache_option
@quiet_option
@gathered("settings", _settings)
def converge(
    scene: Path,
    settings: ConvergenceSettings,
    csv_file: Path | None,
    output: Path | None,
    as_json: bool,
    force: bool,
    quiet: bool,
) -> None:
    """Measure the run time and error of SCENE at increasing sample counts: seconds, rays and RMSE.

    The reference has other random numbers and many more samples, in two halves whose difference estimates its
    own error; it is cached between runs. `random needs` is the factor by which independent random samples
    need more samples for the same error. Seconds are those of ray casting and shading, without reading the
    scene.
    """
    import json
    import sys

    from illumcli.accuracy.convergence import measure_convergence
    from illumcli.accuracy.convergence_files import ConvergenceFiles
    from illumcli.accuracy.convergence_table import convergence_table, text_plot
    from illumcli.cli._progress import reporter

    files = ConvergenceFiles(csv_file, output, force)
    result = measure_convergence(scene, settings, reporter(quiet), files.look)
    files.write(result)
    if not quiet:
        say_kept(files.kept)
    if as_json:
        click.echo(json.dumps(result.as_data(), indent=2))
        return
    click.echo(convergence_table(result))
    if sys.stdout.isatty():
        click.echo(text_plot(result.curves))
