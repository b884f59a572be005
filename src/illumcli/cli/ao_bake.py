"""``illum ao-bake``."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from illumcli.cli._options import (
    FALLOFF,
    SAMPLER,
    SCENE,
    RunnerOf,
    cluster_options,
    force_option,
    gathered,
    json_results_option,
    keep_going_option,
    overrides_option,
    quiet_option,
    report_option,
    seed_option,
    shard_option,
    strict_option,
    taken,
    threads_option,
    verbose_option,
)
from illumcli.cli._printing import Results, run_batch, say, say_kept

if TYPE_CHECKING:
    from illumcli.baking.report import BakeReport
    from illumcli.baking.settings import BakeSettings
    from illumcli.commands.bake import BakeRequest

_EPILOG = """\b
Examples:
  illum ao-bake bunny.ply -o bunny.npz
  illum ao-bake parts -o 'baked/{name}.glb'
  illum ao-bake bunny.obj -o bunny.glb -o bunny.ply --target-error 0.005
  illum ao-bake rock.glb -o rock.ao.glb --falloff exponential --tau 2 --max-distance 0.5r --ground y
  illum ao-bake scenes/teapot.yaml -o baked/teapot.npz --occluders own
"""


LARGEST_TEXTURE = 16384
"""Texels of a side."""


class _Distance(click.ParamType):
    name = "D|Dr"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float | str:
        text = str(value)
        if re.fullmatch(r"[0-9.]+([eE][-+]?[0-9]+)?r?", text):
            number = text.removesuffix("r")
            try:
                return text if text.endswith("r") and float(number) > 0 else float(number)
            except ValueError:
                pass
        return self.fail(f"'{text}' is no distance; write 0.2 for scene units, 0.5r for half the radius")


class _Ground(click.ParamType):
    name = "AXIS[:OFFSET]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        from illumcli.baking.ground import Ground
        from illumcli.errors import InputError

        try:
            Ground.of(value)
        except InputError as error:
            raise click.UsageError(str(error)) from error
        return str(value)


class _What(click.ParamType):
    name = "NAME[,NAME]..."

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[str, ...]:
        from illumcli.visibility.channels import whats

        words = value.split(",") if isinstance(value, str) else value
        unknown = [word for word in words if word not in whats()]
        if unknown:
            self.fail(f"'{unknown[0]}' is not one of {', '.join(whats())}")
        return tuple(word for word in whats() if word in words)


class _TextureSize(click.ParamType):
    name = "SIZE|WxH"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        if isinstance(value, tuple):
            return value
        width, _, height = value.partition("x")
        try:
            size = int(width), int(height or width)
        except ValueError:
            size = 0, 0
        if not (min(size) >= 1 and max(size) <= LARGEST_TEXTURE):
            self.fail(f"'{value}' is no size; write 1024, or 2048x1024, at most {LARGEST_TEXTURE} a side")
        return size


_BEYOND_FIT = {
    "target_error": "--target-error works with --method vertex; give --samples",
    "reconstruct": "--reconstruct works with --method vertex",
    "what": "--method fit computes ao alone; --what works with --method vertex",
}


def _settings(options: dict[str, Any]) -> BakeSettings:
    """The `BakeSettings` among the options of the command."""
    from illumcli.baking.settings import BakeSettings

    _refuse_contradictions(options)
    falloff = {name: options.pop(name) for name in ("falloff", "max_distance", "tau", "exponent")}
    options["samples"] = options["samples"] or BakeSettings.samples
    if options["reconstruct"] is None:
        options["reconstruct"] = options["target_error"] is not None
    options["falloff"] = {name: value for name, value in falloff.items() if value is not None}
    options["faces"] = options["faces"].replace("-", "_")
    options["occluders"] = options["occluders"] or ("scene",)
    settings = taken(BakeSettings, options)
    if settings.method == "fit" and settings.beyond_fit is not None:
        raise click.UsageError(_BEYOND_FIT[settings.beyond_fit])
    return settings


def _refuse_contradictions(options: dict[str, Any]) -> None:
    if options["samples"] is not None and options["target_error"] is not None:
        raise click.UsageError("--samples and --target-error exclude each other; give one")
    _refuse_foreign_parameters(options)


def _refuse_foreign_parameters(options: dict[str, Any]) -> None:
    """Refuse parameters that the falloff does not have, and missing ones that it needs."""
    from illumcli.schema.families import member, members, tag_of

    package, falloff = "illumcli.visibility.falloffs", options["falloff"]
    fields = member(package, falloff).model_fields
    for name in ("tau", "exponent"):
        if options[name] is not None and name not in fields:
            owners = [tag_of(cls) for cls in members(package) if name in cls.model_fields]
            raise click.UsageError(f"--{name} belongs to --falloff {' or '.join(owners)}")
    for name, field in fields.items():
        if field.is_required() and options.get(name) is None:
            option = name.replace("_", "-")
            hint = ", as in --max-distance 0.5r" if name == "max_distance" else ""
            raise click.UsageError(f"--falloff {falloff} needs --{option}{hint}")


def _request(options: dict[str, Any]) -> BakeRequest:
    """The `BakeRequest` among the options of the command."""
    from illumcli.baking.settings import BakeOptions
    from illumcli.commands.bake import BakeRequest

    options["settings"] = _settings(options)
    options["options"] = taken(BakeOptions, options)
    return taken(BakeRequest, options)


@click.command(name="ao-bake", epilog=_EPILOG)
@click.argument("inputs", metavar="INPUT...", type=SCENE, nargs=-1, required=True)
@click.option(
    "-o",
    "--output",
    "patterns",
    metavar="OUT",
    multiple=True,
    required=True,
    help=".npz, .ply, .obj, .glb, of textures .png, .exr; may be repeated, may hold {name}, the name of the "
    "input, and those of textures {object}, {material}, {what}.",
)
@click.option("--samples", type=click.IntRange(1, 65536), help="Rays per vertex, by default 256.")
@click.option(
    "--target-error",
    type=click.FloatRange(0, 1, min_open=True),
    metavar="E",
    help="Stop when the root mean square error of all vertices is at most E, instead of --samples.",
)
@click.option(
    "--reconstruct/--no-reconstruct",
    default=None,
    help="Smooth noise with the values around where that lowers the error, which is measured with other "
    "rays. By default with --target-error alone.",
)
@click.option("--max-distance", type=_Distance(), help="Occluders beyond it do not count: 0.2, or 0.5r.")
@click.option(
    "--falloff",
    type=FALLOFF,
    default="step",
    show_default=True,
    help="Weight of an occluder by its distance.",
)
@click.option(
    "--tau", type=click.FloatRange(0, min_open=True), help="Of --falloff exponential, by default 1."
)
@click.option(
    "--exponent", type=click.FloatRange(0, min_open=True), help="Of --falloff power, by default 0.5."
)
@click.option("--sampler", type=SAMPLER, default="spiral", show_default=True)
@click.option(
    "--faces",
    type=click.Choice(["count", "ignore", "one-sided"]),
    default="count",
    show_default=True,
    help="Back faces occlude (count), are transparent (ignore), or end the ray unoccluded (one-sided).",
)
@click.option(
    "--method",
    type=click.Choice(["vertex", "fit"]),
    default="vertex",
    show_default=True,
    help="Evaluate at the vertices, or sample the surface and fit vertex values by least squares.",
)
@click.option(
    "--occluders",
    multiple=True,
    metavar="[OBJECT=]scene|own|NAME|FILE",
    help="What occludes an object beside itself: the scene (default), nothing (own), objects by name, mesh "
    "or scene files, which are not baked. For all objects, or for OBJECT. May be repeated.",
)
@click.option(
    "--ground",
    type=_Ground(),
    help="Add a ground plane below the lowest vertex: the axis that points up, x, y, z, -x, -y or -z; "
    "OFFSET raises it, scene units.",
)
@click.option(
    "--what",
    type=_What(),
    default="ao",
    show_default=True,
    help="What is computed: ao, bent_normal (the mean unoccluded direction), thickness (the mean distance "
    "inwards, scene units), or several: ao,thickness.",
)
@click.option(
    "--color",
    type=click.Choice(["multiply", "replace", "r", "g", "b", "a"]),
    help="What obscurance does to vertex colours: multiply, replace, or fill a channel. By default they "
    "are kept.",
)
@click.option(
    "--split",
    is_flag=True,
    help="In .ply, too, split vertices with several normals, uv or values, as in .glb; copies come last.",
)
@click.option(
    "--texture",
    type=_TextureSize(),
    help="Bake textures of this size over the uv of the meshes, for .png, .exr and .glb outputs.",
)
@click.option(
    "--unwrap",
    type=click.Choice(["missing", "all"]),
    help="Make uv for textures with xatlas: for objects that have none, or for all.",
)
@click.option("--bits", type=click.Choice([8, 16]), default=8, show_default=True, help="Of textures as .png.")
@click.option(
    "--preview",
    metavar="PNG",
    help="Also draw the result from four sides, w alone and in light, with a histogram; may hold {name}.",
)
@seed_option("Random seed.", default=0)
@threads_option
@overrides_option
@report_option
@json_results_option
@force_option()
@keep_going_option
@cluster_options
@strict_option
@shard_option
@quiet_option
@verbose_option
@gathered("request", _request)
def ao_bake(
    inputs: tuple[Path, ...],
    request: BakeRequest,
    report: Path | None,
    runner: RunnerOf,
    as_json: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Bake obscurance at the vertices of each INPUT, a mesh, scene or folder; print the path of each file.

    1 is open. Values are in the order of the file's vertices, each with its standard error. A vertex with
    several normals has the mean of their values, and all of them if the file format allows. An interrupted
    bake resumes when the same command is given again.
    """
    from illumcli.cli._progress import reporter
    from illumcli.commands.bake_folders import with_folders

    def written(source: Path, paths: list[Path], done: BakeReport) -> None:
        results.add(paths, lambda: {"input": str(source), **done.as_data()})
        if not quiet:
            _say_report(source, done, verbose)
        if verbose:
            if done.ray_loop:
                say(f"rays: {done.ray_loop}")
            for name, seconds in done.seconds.items():
                say(f"{seconds:8.3f} s  {name}")

    do: Callable[..., list[Path] | str]
    if request.shard is None:
        from illumcli.commands.bake import bake_inputs as do
    else:
        from illumcli.commands.bake_shard import bake_shard as do

    results = Results(as_json)

    def bake_all() -> list[Path] | str:
        named = with_folders(inputs)
        for line in () if quiet else named.passed_over:
            say(line)
        return do(named.paths, request, report, runner(reporter(quiet)), written, results.fail)

    run_batch(results, bake_all, quiet)


def _say_report(source: Path, report: BakeReport, verbose: bool) -> None:
    from illumcli.render_graph.repairs import repair_lines

    say_kept(report.kept)
    for line in repair_lines(report.repairs, verbose):
        say(f"{source}: {line}")
    for text in dict.fromkeys(report.left_out):
        say(f"left out: {text}")
    for text in report.warnings:
        say(text)
    if report.written:
        say(f"{source}: {report.summary()}")
