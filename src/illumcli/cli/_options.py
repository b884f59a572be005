"""Options that several commands share."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from dataclasses import fields
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, cast

import click

if TYPE_CHECKING:
    from illumcli.commands.options import RenderOptions, Shard
    from illumcli.commands.runner import Runner
    from illumcli.progress import Progress
    from illumcli.records import Value
    from illumcli.scene.variants import Variant

RunnerOf: TypeAlias = "Callable[[Progress], Runner]"
"""From what is told about progress to who does the work."""
C = TypeVar("C", bound=Callable[..., Any])
R = TypeVar("R", bound="Value")


class _Names(click.Choice):
    """A choice among the names of a table, which is imported when the option is used or shown."""

    def __init__(self, table: Callable[[], Iterable[str]]) -> None:
        self.case_sensitive = True
        self._table = table

    @property
    def choices(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple(self._table())


def _samplers() -> Iterable[str]:
    from illumcli.visibility.samplers import SAMPLERS

    return SAMPLERS


def _falloffs() -> Iterable[str]:
    from illumcli.schema.sources import tags

    return tags("illumcli.visibility.falloffs")


SAMPLER = _Names(_samplers)
FALLOFF = _Names(_falloffs)
FILE = click.Path(path_type=Path)
SCENE = FILE
"""Whether a scene exists is checked when it is read: a missing scene does not stop the others."""

scene_argument = click.argument("scene", type=SCENE)
scenes_argument = click.argument("scenes", metavar="SCENE...", type=SCENE, nargs=-1, required=True)


def overrides_option(command: C) -> C:
    """Adds `-D` as the parameter `overrides`, and `--allow` and `--models`, which reach `load` by the
    environment."""
    replaced = click.option(
        "-D",
        "overrides",
        multiple=True,
        metavar="PATH=VALUE",
        help="Replace a value of the scene, as in -D film.samples=16; the value is YAML.",
    )
    return replaced(allow_option(models_option(command)))


def _add_to(variable: str, folders: Iterable[str]) -> None:
    """Add folders to those of an environment variable, which workers inherit."""
    given = [os.environ[variable]] if os.environ.get(variable) else []
    os.environ[variable] = os.pathsep.join(dict.fromkeys([*given, *folders]))


def _allow(ctx: click.Context, option: click.Parameter, folders: tuple[str, ...]) -> None:
    if folders:
        _add_to("ILLUM_ALLOW", folders)


allow_option = click.option(
    "--allow",
    multiple=True,
    expose_value=False,
    callback=_allow,
    type=click.Path(exists=True, file_okay=False),
    metavar="DIR",
    help="Let scenes read files and write images below DIR, too (also: ILLUM_ALLOW).",
)


_MODELS = f"{__name__}.models"
"""Where a context keeps the folders of `--models`."""


def _models(ctx: click.Context, option: click.Parameter, folders: tuple[str, ...]) -> None:
    if folders:
        _add_to("ILLUM_MODELS", map(os.path.abspath, folders))
        ctx.meta[_MODELS] = folders


def models_words() -> list[str]:
    """The `--models` of the running command, as words for another one."""
    folders = click.get_current_context().meta.get(_MODELS, ())
    return [word for folder in folders for word in ("--models", folder)]


models_option = click.option(
    "--models",
    "folders_of_models",
    multiple=True,
    expose_value=False,
    callback=_models,
    type=click.Path(exists=True, file_okay=False),
    metavar="DIR",
    help="Run the Python files of DIR, each an illumination model (also: ILLUM_MODELS).",
)


def _shard(ctx: click.Context, option: click.Parameter, text: str | None) -> Shard | None:
    from illumcli.commands.options import Shard

    if text is None:
        return None
    match = re.fullmatch(r"0*([1-9]\d{0,5})/0*([1-9]\d{0,5})", text)
    if match is None or int(match[1]) > int(match[2]):
        raise click.BadParameter(f"'{text}' is not I/N with I from 1 to N; write it as 1/3")
    return Shard(int(match[1]), int(match[2]))


shard_option = click.option(
    "--shard",
    metavar="I/N",
    callback=_shard,
    help="Do part I of N, from 1, and leave a record; see illum merge.",
)


def _view(ctx: click.Context, option: click.Parameter, text: str | None) -> str | None:
    """`AZIMUTH,ELEVATION` as a list; both must be numbers, whose ranges `load` checks."""
    if text is None:
        return None
    try:
        azimuth, elevation = map(float, text.split(","))
    except ValueError:
        raise click.BadParameter(f"'{text}' is not AZIMUTH,ELEVATION; write it as 24,13") from None
    return f"[{azimuth}, {elevation}]"


def studio_options(command: C) -> C:
    """Adds `--view` and `--up` for meshes without a scene, in front of the parameter `overrides`."""

    @wraps(command)
    def arranged(*args: Any, view: str | None, up: str | None, **named: Any) -> Any:
        given = {"view": view, "up": up}
        studio = tuple(f"studio.{key}={value}" for key, value in given.items() if value is not None)
        return command(*args, **{**named, "overrides": (*studio, *named["overrides"])})

    look = click.option(
        "--view",
        metavar="AZIMUTH,ELEVATION",
        callback=_view,
        help="View of a mesh without a scene [degrees]: 0,0 is the front, 90,0 the side of +x, 0,90 from "
        "above. By default 24,13.",
    )
    turn = click.option(
        "--up",
        type=click.Choice(["x", "y", "z", "-x", "-y", "-z"]),
        help="The up axis of a mesh without a scene; by default y.",
    )
    return cast(C, look(turn(arranged)))


frames_option = click.option(
    "--frames",
    metavar="FIRST:LAST[:STEP]",
    help="Frames to render, by default the scene's; values of -D may be formulas of frame and time.",
)


def _variants(options: dict[str, Any]) -> list[Variant]:
    from illumcli.scene.load import read_frames
    from illumcli.scene.variants import variants_of

    names = ("overrides", "together", "rows", "frames")
    overrides, together, rows, frames = (options.pop(name) for name in names)
    return variants_of(overrides, together, rows, frames, read_frames(options["scene"], overrides))


def variants_options(command: C) -> C:
    """Adds `-D`, `--zip`, `--rows`, `--frames` and the options of meshes, as the parameter `variants`."""
    values = click.option(
        "-D",
        "overrides",
        multiple=True,
        metavar="PATH=VALUES",
        help="Values of a path: a,b,c or START:STOP:COUNT or START:STOP:COUNTlog; NAME:VALUE names a value.",
    )
    together = click.option(
        "--zip", "together", is_flag=True, help="First values together, then second ones, ..."
    )
    rows = click.option(
        "--rows", type=FILE, metavar="FILE.csv", help="A variant per row: paths in the first line."
    )
    taking = gathered("variants", _variants)(command)
    return values(studio_options(together(rows(frames_option(taking)))))


pattern_option = click.option(
    "-o", "--output", "pattern", metavar="PATTERN", help="Name pattern of the images, .exr or .png."
)

only_option = click.option(
    "--only", multiple=True, metavar="LAYER", help="Render only this layer; may be repeated."
)

threads_option = click.option(
    "-t", "--threads", type=click.IntRange(1, 1024), help="Number of threads; by default one per core."
)

report_option = click.option(
    "--report", type=FILE, metavar="FILE.json", help="Write a report of the run as JSON."
)

html_option = click.option(
    "--html", type=FILE, metavar="DIR", help="Write a report for a browser: pictures, filters, comparison."
)

json_option = click.option("--json", "as_json", is_flag=True, help="Print JSON instead of a table.")

json_results_option = click.option(
    "--json", "as_json", is_flag=True, help="Print a list of what was done as JSON, instead of paths."
)


def seed_option(text: str, default: int | None = None) -> Callable[[C], C]:
    """Adds `--seed` with a help text of its own."""
    return click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=default, help=text)


def force_option(text: str = "Replace different files, and write equal ones again.") -> Callable[[C], C]:
    """Adds `--force`."""
    return click.option("--force", is_flag=True, help=text)


keep_going_option = click.option(
    "--keep-going/--stop-at-first",
    default=True,
    show_default=True,
    help="If one of several fails, finish the others, or stop. The exit code is that of the first failure.",
)


def _runner(options: dict[str, Any]) -> RunnerOf:
    """The runner that the options ask for."""
    cluster, is_mixed = options.pop("cluster"), options.pop("mixed_workers")
    if cluster is None:
        if is_mixed:
            raise click.UsageError("--mixed-workers is for --cluster; give --cluster, too")
        from illumcli.commands.runner import Here

        return Here
    from illumcli.cluster.address import address_of
    from illumcli.cluster.runner import ClusterRunner

    return partial(ClusterRunner, address_of(cluster), is_mixed, lambda text: click.echo(text, err=True))


def cluster_options(command: C) -> C:
    """Adds `--cluster` and `--mixed-workers` as the parameter `runner`."""
    where = click.option(
        "--cluster",
        metavar="local[:N]|tcp://HOST:PORT|FILE",
        help="Let the workers of a Dask cluster do the work: N processes here, or those of a scheduler.",
    )
    mixed = click.option(
        "--mixed-workers",
        is_flag=True,
        help="Allow workers of other versions or processors; the last digits of pixels then depend on them.",
    )
    return where(mixed(gathered("runner", _runner)(command)))


quiet_option = click.option(
    "-q",
    "--quiet",
    is_flag=True,
    help="Print only results and problems: no progress, no counts.",
)

verbose_option = click.option(
    "-v",
    "--verbose",
    is_flag=True,
    help="Print more: what was skipped, repaired and reused, and where time was spent.",
)


def with_common(command: click.Command) -> click.Command:
    """The command and its subcommands with `-q` and `-v`; commands without these options ignore them."""
    for below in command.commands.values() if isinstance(command, click.Group) else ():
        with_common(below)
    taken = {option.name for option in command.params}
    for name, option in (("quiet", quiet_option), ("verbose", verbose_option)):
        if name not in taken and not isinstance(command, click.Group):
            option(command)
            next(each for each in command.params if each.name == name).expose_value = False
    return command


strict_option = click.option(
    "--strict", is_flag=True, help="Refuse meshes and textures that need repairs, instead of counting them."
)


no_cache_option = click.option(
    "--no-cache",
    "cache",
    flag_value=False,
    default=True,
    help="Neither read nor write the cache; see illum cache.",
)


def gathered(name: str, take: Callable[[dict[str, Any]], object]) -> Callable[[C], C]:
    """Hands several options to a command as the one parameter `name`.

    `take` removes them from the options by name, and returns a record of them.
    """

    def decorate(command: C) -> C:
        @wraps(command)
        def with_record(**options: Any) -> Any:
            record = take(options)
            return command(**options, **{name: record})

        return cast(C, with_record)

    return decorate


def taken(record: type[R], options: dict[str, Any]) -> R:
    """A record of those options that are its fields; they are removed."""
    names = [field.name for field in fields(record) if field.name in options]
    return record(**{name: options.pop(name) for name in names})


def render_options(options: dict[str, Any]) -> RenderOptions:
    """The `RenderOptions` among the options of a command."""
    from illumcli.commands.options import RenderOptions

    return taken(RenderOptions, options)
