"""`illum compare`: how far apart two images are, and whether that is too far."""

from __future__ import annotations

from pathlib import Path

import click

from illumcli.cli._options import quiet_option

_FILE = click.Path(path_type=Path)
_EPILOG = """\b
Examples:
  illum compare reference.exr new.exr
  illum compare reference.exr new.exr --layer beauty --max-rmse 0.001
  illum compare a.png b.png --heat difference.png
  illum compare a.exr b.exr --json --no-flip
"""


@click.command(epilog=_EPILOG)
@click.argument("reference", metavar="A", type=_FILE)
@click.argument("test", metavar="B", type=_FILE)
@click.option("--layer", "names", multiple=True, metavar="NAME", help="Only this layer; may be repeated.")
@click.option(
    "--heat",
    type=_FILE,
    metavar="FILE.png",
    help="Picture of |B - A|, largest over channels, in false colours.",
)
@click.option("--force", is_flag=True, help="Replace a picture of --heat that differs.")
@click.option("--max-rmse", type=float, metavar="X", help="Root of the mean squared difference.")
@click.option("--max-mae", type=float, metavar="X", help="Mean absolute difference.")
@click.option("--max-relative", type=float, metavar="X", help="Mean of (B - A)^2 / (A^2 + 0.01).")
@click.option("--min-psnr", type=float, metavar="X", help="Peak signal to noise [dB].")
@click.option("--max-flip", type=float, metavar="X", help="Mean FLIP error, 0 to 1.")
@click.option("--max-difference", type=float, metavar="X", help="Largest absolute difference.")
@click.option("--no-flip", is_flag=True, help="Leave FLIP out, which takes most of the time.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")
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

    from illumcli.commands.compare import as_data, as_table, check, run

    limits = {name: bound for name, bound in bounds.items() if bound is not None}
    if no_flip and "max_flip" in limits:
        raise click.UsageError("--max-flip needs FLIP; leave --no-flip out")
    comparison = run(reference, test, names, not no_flip, heat, force)
    if comparison.heat_is_kept and not quiet:
        click.echo(f"{heat}: kept, its content is the same", err=True)
    if as_json:
        click.echo(json.dumps(as_data(comparison), indent=2))
    else:
        click.echo(as_table(comparison))
        if heat is not None:
            layer = comparison.layers[0].name
            click.echo(
                f"{heat}: {layer}, black is 0, pale yellow is {comparison.heat_scale:.6g}, cyan is NaN"
            )
    check(comparison, limits)
