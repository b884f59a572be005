"""``illum brdf``."""

from __future__ import annotations

from pathlib import Path

import click

from illumcli.cli._options import FILE, force_option, models_option, quiet_option
from illumcli.cli._printing import print_paths, say_kept

_EPILOG = """\b
Examples:
  illum brdf lambert oren_nayar -D oren_nayar.sigma=0.5
  illum brdf ward ward -D 1.alpha_y=0.1 -D 2.alpha_y=0.5 --view sphere -o ward.png
  illum brdf cook_torrance -D distribution='{D: ggx, alpha: 0.1}' --log --view polar -o ggx.svg
  illum brdf phong --angle 20 --angle 60 --times-cos --csv phong.csv
"""


@click.command(epilog=_EPILOG)
@click.argument("models", metavar="MODEL...", nargs=-1, required=True)
@click.option(
    "-D",
    "overrides",
    multiple=True,
    metavar="PARAMETER=VALUE",
    help="A parameter of every model, or of one: oren_nayar.sigma=0.5, or 2.sigma=0.5 for the second.",
)
@click.option(
    "-o", "--output", type=FILE, help="The picture, .png or .svg; brdf.png unless --csv is given alone."
)
@click.option("--csv", "table", type=FILE, metavar="FILE", help="Write the polar slices as a table.")
@click.option(
    "--view",
    "chosen",
    multiple=True,
    type=click.Choice(["polar", "sphere", "plane", "lobe", "all"]),
    default=("all",),
    show_default=True,
    help="What to draw; may be repeated.",
)
@click.option(
    "--angle",
    "angles",
    multiple=True,
    type=click.FloatRange(0, 90, max_open=True),
    default=(15.0, 40.0, 65.0),
    show_default=True,
    metavar="DEGREES",
    help="Angle of incidence of the polar slices; may be repeated. The lobe is that of the middle one.",
)
@click.option("--log", is_flag=True, help="Slices and lobes on a logarithmic scale, four decades.")
@click.option("--times-cos", is_flag=True, help="The response, cosine included, instead of the BRDF.")
@models_option
@force_option("Replace files that differ.")
@quiet_option
def brdf(
    models: tuple[str, ...],
    overrides: tuple[str, ...],
    output: Path | None,
    table: Path | None,
    chosen: tuple[str, ...],
    angles: tuple[float, ...],
    log: bool,
    times_cos: bool,
    force: bool,
    quiet: bool,
) -> None:
    """Draw illumination models side by side; print the path of every file written.

    Polar slices in the plane of incidence, a sphere and a floor under one light, the lobe in space. Slices
    and lobes share one scale; they show response / n.l, for the intensity models the BRDF that would give
    the same picture. Pictures need matplotlib: pip install 'illumcli[plot]'.
    """
    from illumcli.brdf import VIEWS, Plot, draw_brdfs

    if output is None and table is None:
        output = Path("brdf.png")
    views = VIEWS if "all" in chosen else [view for view in VIEWS if view in chosen]
    plot = Plot(views, angles, log, times_cos)
    paths, kept = draw_brdfs(models, overrides, output, table, plot, force)
    print_paths(paths)
    if not quiet:
        say_kept(kept)
