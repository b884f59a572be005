"""`illum measure`: a virtual gonioreflectometer."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import click

from illumcli.cli._options import (
    FILE,
    RunnerOf,
    cluster_options,
    force_option,
    gathered,
    quiet_option,
    seed_option,
    taken,
    threads_option,
)
from illumcli.cli._printing import print_paths, say, say_kept

if TYPE_CHECKING:
    from illumcli.commands.measure import MeasureRequest

_EPILOG = """\b
Examples:
  illum measure '0.1*sin(2*pi*x)' -o corrugated.npz --anisotropic --facets lambert
  illum measure 'abs(mod(x, 1) - 0.5)' --facets lambert --albedo 0.9 --bounces 4 -o grooves.binary
  illum measure heights.png --height 0.05 -o sand.binary
  illum measure tile.obj --period 1 --fresnel copper --target-error 0.02 -o hammered.binary
"""


class _Numbers(click.ParamType):
    """Some numbers separated by commas; one stands for all."""

    def __init__(self, count: int, name: str, low: float, high: float) -> None:
        self.name, self._count, self._low, self._high = name, count, low, high

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[float, ...]:
        if isinstance(value, tuple):
            return value
        words = re.split(r"\s*,\s*", str(value).strip())
        try:
            numbers = tuple(float(word) for word in words)
        except ValueError:
            numbers = ()
        numbers = numbers * self._count if len(numbers) == 1 else numbers
        if len(numbers) != self._count or not all(self._low <= each <= self._high for each in numbers):
            self.fail(
                f"'{value}' is not one number or {self._count}, separated by commas, "
                f"from {self._low:g} to {self._high:g}"
            )
        return numbers


def _request(options: dict[str, Any]) -> MeasureRequest:
    """The `MeasureRequest` among the options of the command."""
    from illumcli.commands.measure import MeasureRequest
    from illumcli.gonioreflectometer.settings import MeasureSettings, SurfaceSource
    from illumcli.gonioreflectometer.work import MeasureOptions

    if options["samples"] is not None and options["target_error"] is not None:
        raise click.UsageError("--samples and --target-error exclude each other; give one")
    if options["facets"] == "mirror" and options["albedo"] is not None:
        raise click.UsageError("--albedo belongs to --facets lambert; mirrors have --fresnel")
    if options["facets"] == "lambert" and options["fresnel"] is not None:
        raise click.UsageError("--fresnel belongs to --facets mirror; Lambertian facets have --albedo")
    if options["step"] is not None and options["isotropic"]:
        raise click.UsageError("--step belongs to --anisotropic; a MERL table has steps of its own")
    step = options["step"] or 10.0
    if abs(90 / step - round(90 / step)) > 1e-9:
        raise click.UsageError(f"--step {step:g} does not divide 90 degrees; take 5, 6, 7.5, 9, 10 or 15")
    options |= {
        "step": step,
        "samples": 8 * -(-(options["samples"] or 64) // 8),
        "albedo": options["albedo"] or (0.8, 0.8, 0.8),
    }
    options["source"] = taken(SurfaceSource, options)
    options["settings"] = taken(MeasureSettings, options)
    options["options"] = MeasureOptions(options.pop("threads"))
    return taken(MeasureRequest, options)


@click.command(epilog=_EPILOG)
@click.argument("text", metavar="SURFACE")
@click.option(
    "-o",
    "--output",
    type=FILE,
    required=True,
    metavar="TABLE",
    help=".binary (MERL, with an .npz of the errors beside it) or .npz alone.",
)
@click.option(
    "--facets",
    type=click.Choice(["mirror", "lambert"]),
    default="mirror",
    show_default=True,
    help="What each point of the surface is.",
)
@click.option("--albedo", type=_Numbers(3, "R[,G,B]", 0, 1), help="Of Lambertian facets, by default 0.8.")
@click.option(
    "--fresnel",
    metavar="MATERIAL|INDEX",
    help="Reflectance of mirrors: copper, aluminium, glass, ..., or the index of a dielectric; by default 1.",
)
@click.option(
    "--bounces",
    type=click.IntRange(1, 64),
    default=1,
    show_default=True,
    help="Times that light may meet the surface.",
)
@click.option(
    "--isotropic/--anisotropic",
    default=True,
    show_default=True,
    help="Average over all turns of the surface, or keep the azimuths of light and eye (.npz).",
)
@click.option(
    "--step", type=click.FloatRange(2, 30), help="Of the angles with --anisotropic [degrees], by default 10."
)
@click.option(
    "--period",
    type=_Numbers(2, "P|PX,PY", 0, 1e12),
    help="After which the surface repeats along x and y. By default 1 for formulas, 1 in width for "
    "pictures, 0 for meshes, which are then single pieces.",
)
@click.option("--height", type=float, help="Of a picture: how far white lies above black.")
@click.option(
    "--grid",
    type=click.IntRange(4, 2048),
    default=512,
    show_default=True,
    help="Of a formula: points along the longer period.",
)
@click.option(
    "--up",
    type=click.Choice(["x", "y", "z", "-x", "-y", "-z"]),
    default="z",
    show_default=True,
    help="Of a mesh.",
)
@click.option(
    "--footprint",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    default=0.5,
    show_default=True,
    help="Of a single piece: the side of what is measured over that of the piece.",
)
@click.option(
    "--resolution",
    type=click.FloatRange(0.01, 10),
    default=0.5,
    show_default=True,
    help="Of mirrors: facets within so many degrees of the half vector's polar angle count.",
)
@click.option("--samples", type=click.IntRange(8, 65536), help="Per cell, by default 64; a multiple of 8.")
@click.option(
    "--target-error",
    type=click.FloatRange(0, 1, min_open=True),
    metavar="E",
    help="Sample until the standard errors of each part of a row are at most E of its values.",
)
@seed_option("Random seed.", default=0)
@threads_option
@force_option()
@cluster_options
@quiet_option
@gathered("request", _request)
def measure(request: MeasureRequest, runner: RunnerOf, quiet: bool) -> None:
    """Measure the BRDF of SURFACE: a formula of its height in x and y, a picture of heights, or a mesh.

    Light and eye go around a small surface with real bumps; every cell of the table has a standard error.
    A MERL table can be rendered at once (model: merl). An interrupted measurement resumes when the same
    command is given again.
    """
    from illumcli.cli._progress import reporter
    from illumcli.commands.measure import measure_surface

    def tell(line: str) -> None:
        if not quiet:
            say(line)

    files, is_kept = measure_surface(request, runner(reporter(quiet)), tell)
    if is_kept and not quiet:
        say_kept(files)
    print_paths(files)
