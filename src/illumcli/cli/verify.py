"""`illum verify`: the deviations of the models from reference vectors."""

from __future__ import annotations

from pathlib import Path

import click

from illumcli.cli._options import FILE, json_option, models_option

_EPILOG = """\b
Examples:
  illum verify
  illum verify --only phong --only cook_torrance
  illum verify --precision single
  illum verify my_vectors.json --json
  illum verify scene.yaml --only velvet
  illum verify --models my_models --only fuzz
"""


@click.command(epilog=_EPILOG)
@click.argument("file", required=False, type=FILE)
@click.option(
    "--precision",
    type=click.Choice(["double", "single"]),
    default="double",
    show_default=True,
    help="`single` runs the formulas in float32 and reports where digits are lost, with the cause.",
)
@click.option(
    "--only",
    multiple=True,
    metavar="TYPE",
    help="Only this case type, model or material; may be repeated.",
)
@models_option
@json_option
def verify(file: Path | None, precision: str, only: tuple[str, ...], as_json: bool) -> None:
    """Check the renderer's formulas against the vectors in FILE (.json, .json.xz or .json.gz), and the claims
    of illumination models, or those of the materials of a scene (FILE.yaml), at random directions.

    By default the vectors of the package, computed with 50 digits. A case passes if its largest deviation is
    at most atol + rtol * the largest expected value, with its own atol and rtol. Obscurance is estimated by
    casting rays at real geometry; an estimate passes within 4.5 of its own standard errors.

    \b
    worst error  largest deviation over the largest expected value; `se` counts standard errors
    tolerance    what the worst case allows
    used         largest share of its own tolerance that any case of the type needs

    \b
    light        no value is negative or not finite; worst is the share that is
    reciprocal   light and eye may change places; worst relative difference
    isotropic    turning the surface about its normal changes nothing
    conserving   no more light leaves than arrives; worst is the largest reflected share

    Exit status: 0 all within tolerance, 3 some case beyond it or a claim that does not hold, 2 when FILE is
    malformed or holds a case type that is not known. `--precision single` judges nothing.
    """
    import json

    from illumcli import verification as job

    file = file or job.PACKAGED
    if precision == "single":
        single = job.verify_single(file, only)
        click.echo(json.dumps(job.single_data(single), indent=2) if as_json else job.single_table(single))
        return
    is_scene = file.suffix.lower() in (".yaml", ".yml")
    results = [] if is_scene else job.verify(file, only)
    if is_scene:
        claims = job.verify_materials(file, only)
    else:
        claims = job.verify_claims(only) if file == job.PACKAGED else []
    if as_json:
        click.echo(json.dumps(job.as_data(results, claims), indent=2))
    else:
        tables = [job.as_table(results)] if results else []
        click.echo("\n\n".join([*tables, *([job.claims_table(claims)] if claims else [])]))
    job.refuse_failures(results, claims)
