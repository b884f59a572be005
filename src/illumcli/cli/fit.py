"""``illum fit``."""

from __future__ import annotations

from pathlib import Path

import click

from illumcli.cli._options import FILE, force_option, quiet_option
from illumcli.cli._printing import say
from illumcli.cli._progress import reporter

_EPILOG = """\b
Examples:
  illum fit brass.binary --model ward
  illum fit brass.binary --model cook_torrance -D distribution='{D: ggx}' -o brass.png
  illum fit brass.binary --model ward --model lafortune --metric cube_root
  illum fit scenes/satin.csv --model ward --model ashikhmin_shirley --json
"""


@click.command(epilog=_EPILOG)
@click.argument("file", type=FILE)
@click.option(
    "--model",
    "models",
    metavar="NAME",
    multiple=True,
    required=True,
    help="The model to fit; if given several times, the models are compared.",
)
@click.option(
    "-D",
    "overrides",
    multiple=True,
    metavar="PARAMETER=VALUE",
    help="A choice of the model, or a number that is not to be fitted; as in illum brdf.",
)
@click.option(
    "--lobes",
    type=click.IntRange(1, 8),
    default=1,
    show_default=True,
    help="Number of specular lobes, for models that have a list of them.",
)
@click.option(
    "--metric",
    type=click.Choice(["cosine", "cube_root", "log"]),
    default="cosine",
    show_default=True,
    help="What is minimised: the error of f_r n.l, of its cube root, or of ln(1 + f_r n.l).",
)
@click.option("--isotropic", is_flag=True, help="The surface of a table has no grain.")
@click.option("--name", metavar="NAME", help="Name of the material, by default that of the file.")
@click.option("-o", "--output", type=FILE, help="A picture of measurement and fit, .png, .svg or .pdf.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON instead of materials.")
@force_option("Replace a picture that exists.")
@quiet_option
def fit(
    file: Path,
    models: tuple[str, ...],
    overrides: tuple[str, ...],
    lobes: int,
    metric: str,
    isotropic: bool,
    name: str | None,
    output: Path | None,
    as_json: bool,
    force: bool,
    quiet: bool,
) -> None:
    """Fit the parameters of a model to a measured BRDF; print it as a material of a scene.

    FILE is a MERL table (.binary), an RGL file (.bsdf), a table of illum measure (.npz) or of pairs of
    directions (.csv: lx,ly,lz,vx,vy,vz,R,G,B, see docs/fitting.md). stdout has
    `materials:`, ready to paste; stderr has the parameters with their standard errors, three metrics, and
    what the measurement does not determine. Parameters given with -D are not fitted.
    Needs scipy: pip install 'illumcli[fit]'.
    """
    import json

    from illumcli.commands import fit as job
    from illumcli.fitting.material import materials_text
    from illumcli.fitting.report import data, notes, ranking, report, undetermined

    if output is not None:
        job.refuse_picture(output, force)
    options = job.FitOptions(models, overrides, lobes, metric, isotropic)
    fits = job.fit_models(file, options, name, reporter(quiet))
    every = list(fits.by_name.values())

    # What is known of the fits, then the result.
    if not quiet:
        say(f"{file}: {fits.measurement.about}\n")
        for each in every:
            say(f"{report(each)}\n")
        if len(every) > 1:
            say(f"{ranking(every)}\n")
    else:
        for each in every:
            for note in notes(each)[1:]:
                say(note)
    if as_json:
        listed = [data(each, fits.measurement, file, title) for title, each in fits.by_name.items()]
        click.echo(json.dumps(listed, indent=1))
    else:
        materials = {title: each.material for title, each in fits.by_name.items()}
        unknown = {title: undetermined(each) for title, each in fits.by_name.items()}
        click.echo(materials_text(materials, unknown))
    if output is not None:
        job.write_picture(output, file, every, fits.measurement)
        say(str(output))
