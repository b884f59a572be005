"""``illum brdf``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from illumcli.cli._options import FILE, force_option, gathered, models_option, quiet_option, taken
from illumcli.cli._printing import print_paths, say, say_kept

if TYPE_CHECKING:
    from illumcli.brdf import Plot

_EPILOG = """\b
Examples:
  illum brdf lambert oren_nayar -D oren_nayar.sigma=0.5
  illum brdf ward ward -D 1.alpha_y=0.1 -D 2.alpha_y=0.5 --view sphere -o ward.png
  illum brdf cook_torrance -D distribution='{D: ggx, alpha: 0.1}' --log --view polar -o ggx.svg
  illum brdf phong --angle 20 --angle 60 --times-cos --csv phong.csv
  illum brdf lambert oren_nayar --overlay --view cartesian --view albedo -o rough.pdf
  illum brdf burley --merl burley.binary
"""


def _plot(options: dict[str, Any]) -> Plot:
    from illumcli.brdf.plot import Plot, in_order

    options["views"] = in_order(options["views"])
    return taken(Plot, options)


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
    "-o",
    "--output",
    type=FILE,
    help="The figure, .png, .svg or .pdf; brdf.png unless --csv or --merl is given alone.",
)
@click.option("--csv", "table", type=FILE, metavar="FILE", help="Write the polar slices as a table.")
@click.option(
    "--merl", type=FILE, metavar="FILE", help="Write one isotropic model as a MERL .binary table, 35 MB."
)
@click.option(
    "--view",
    "views",
    multiple=True,
    type=click.Choice(["polar", "cartesian", "across", "albedo", "sphere", "plane", "lobe", "all"]),
    default=("polar", "sphere", "plane", "lobe"),
    show_default=True,
    help="What to draw; may be repeated. Slices in the plane of incidence are `polar` or `cartesian`; "
    "`across` runs through the mirror direction at right angles to it.",
)
@click.option(
    "--angle",
    "angles",
    multiple=True,
    type=click.FloatRange(0, 90, max_open=True),
    default=(15.0, 40.0, 65.0),
    show_default=True,
    metavar="DEGREES",
    help="Angle of incidence of the slices; may be repeated. The lobe is that of the middle one.",
)
@click.option(
    "--log/--lin", "log", help="Slices and lobes on a logarithmic scale, four decades, or a linear one."
)
@click.option("--times-cos", is_flag=True, help="The response, cosine included, instead of the BRDF.")
@click.option("--overlay", is_flag=True, help="The curves of all models on one axis, with a legend.")
@click.option("--per-channel", is_flag=True, help="A curve of R, G and B each, instead of luminance.")
@click.option(
    "--label",
    "labels",
    multiple=True,
    metavar="TEXT",
    help="What the figure calls a model, once for each; $...$ is a formula.",
)
@click.option(
    "--width",
    type=click.FloatRange(1, 40),
    metavar="INCHES",
    help="Of the whole figure: 3.3 fits a column of a paper, 7 a page. By default 3.1 for each model.",
)
@models_option
@force_option("Replace files that differ.")
@quiet_option
@gathered("plot", _plot)
def brdf(
    models: tuple[str, ...],
    overrides: tuple[str, ...],
    output: Path | None,
    table: Path | None,
    merl: Path | None,
    plot: Plot,
    force: bool,
    quiet: bool,
) -> None:
    """Draw illumination models side by side; print the path of every file written.

    Slices in the plane of incidence and across it, albedo against the angle of incidence, a sphere and a
    floor under one light, the lobe in space. Slices and lobes share one scale; they show response / n.l, for
    the intensity models the BRDF that would give the same picture. Figures need matplotlib: pip install
    'illumcli[plot]'.
    """
    from illumcli.brdf import draw_brdfs, write_merl

    if output is None and table is None and merl is None:
        output = Path("brdf.png")
    paths, kept, notes = draw_brdfs(models, overrides, output, table, plot, force)
    print_paths(paths)
    if merl is not None:
        kept_table, notes_table = write_merl(models, overrides, merl, force)
        print_paths([merl])
        kept += kept_table
        notes += notes_table
    if not quiet:
        say_kept(kept)
        for note in notes:
            say(note)
