"""`illum compare`: the differences of two images, and limits on them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from illumcli.cli._options import FILE, force_option, json_option, quiet_option
from illumcli.cli._printing import say_kept

if TYPE_CHECKING:
    from illumcli.commands.compare import Comparison
    from illumcli.images.comparison import LayerDifference

_EPILOG = """\b
Examples:
  illum compare reference.exr new.exr
  illum compare reference.exr new.exr --layer beauty --max-rmse 0.001
  illum compare a.png b.png --heat difference.png
  illum compare a.exr b.exr --json --no-flip
"""


@click.command(epilog=_EPILOG)
@click.argument("reference", metavar="A", type=FILE)
@click.argument("test", metavar="B", type=FILE)
@click.option("--layer", "names", multiple=True, metavar="NAME", help="Only this layer; may be repeated.")
@click.option(
    "--heat",
    type=FILE,
    metavar="FILE.png",
    help="Picture of |B - A|, largest over channels, in false colours.",
)
@force_option("Replace a picture of --heat that differs.")
@click.option("--max-rmse", type=float, metavar="X", help="Root of the mean squared difference.")
@click.option("--max-mae", type=float, metavar="X", help="Mean absolute difference.")
@click.option("--max-relative", type=float, metavar="X", help="Mean of (B - A)^2 / (A^2 + 0.01).")
@click.option("--min-psnr", type=float, metavar="X", help="Peak signal to noise [dB].")
@click.option("--max-flip", type=float, metavar="X", help="Mean FLIP error, 0 to 1.")
@click.option("--max-difference", type=float, metavar="X", help="Largest absolute difference.")
@click.option("--no-flip", is_flag=True, help="Leave FLIP out, which takes most of the time.")
@json_option
@quiet_option
def compare(
    reference: Path,
    test: Path,
    names: tuple[str, ...],
    heat: Path | None,
    force: bool,
    no_flip: bool,
    as_json: bool,
    quiet: bool,
    **bounds: float | None,
) -> None:
    """Compare image B with the reference A, layer by layer.

    R, G, B and A are the layer `beauty`; a channel `P.X` is of the layer `P`. NaN and infinite values are
    counted and left out of the means. Peak of the PSNR: 1 for display values, else the largest value of A.

    Exit status: 0 within all limits given, 3 beyond one (NaN is beyond any), 2 when the files cannot be read
    or differ in size.
    """
    import json

    from illumcli.commands.compare import compare_images
    from illumcli.commands.compare_limits import refuse_beyond_limits

    limits = {name: bound for name, bound in bounds.items() if bound is not None}
    if no_flip and "max_flip" in limits:
        raise click.UsageError("--max-flip needs FLIP; leave --no-flip out")
    comparison = compare_images(reference, test, names, not no_flip, heat, force)
    if comparison.heat_is_kept and not quiet:
        say_kept([heat])
    if as_json:
        click.echo(json.dumps(comparison.as_data(), indent=2))
    else:
        click.echo(comparison_table(comparison))
        if heat is not None:
            layer = comparison.layers[0].name
            click.echo(
                f"{heat}: {layer}, black is 0, pale yellow is {comparison.heat_scale:.6g}, cyan is NaN"
            )
    refuse_beyond_limits(comparison, limits)


def comparison_table(comparison: Comparison) -> str:
    """A line per layer, and the channels that only one image has."""
    from illumcli.tables import aligned

    titles = (
        "layer",
        "channels",
        "RMSE",
        "rel. MSE",
        "MAE",
        "PSNR",
        "FLIP",
        "largest",
        "at x, y",
        "not finite",
    )
    lines = aligned([titles, *(_row(layer) for layer in comparison.layers)])
    for path, only in (
        (comparison.reference, comparison.only_in_reference),
        (comparison.test, comparison.only_in_test),
    ):
        if only:
            lines.append(f"only in {path}: {', '.join(only)}")
    return "\n".join(lines)


def _row(layer: LayerDifference) -> tuple[str, ...]:
    difference, (x, y, channel) = layer.difference, layer.place
    measures = (difference.rmse, difference.relative_mse, difference.mae, difference.psnr)
    return (
        layer.name,
        " ".join(name.rpartition(".")[2] for name in layer.channels),
        *(f"{value:.4g}" for value in measures),
        "-" if layer.flip is None else f"{layer.flip:.4g}",
        f"{difference.largest:.4g}",
        f"{x}, {y} {channel.rpartition('.')[2]}" if difference.largest else "-",
        str(difference.not_finite),
    )
