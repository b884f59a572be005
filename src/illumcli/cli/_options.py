"""Options that several commands share."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

C = TypeVar("C", bound=Callable[..., Any])

SCENE = click.Path(exists=True, dir_okay=False, path_type=Path)

scene_argument = click.argument("scene", type=SCENE)
scenes_argument = click.argument("scenes", metavar="SCENE...", type=SCENE, nargs=-1, required=True)


def overrides_option(command: C) -> C:
    """Adds `-D` as the parameter `overrides`, and `--allow`, which reaches `load` by the environment."""
    replaced = click.option(
        "-D",
        "overrides",
        multiple=True,
        metavar="PATH=VALUE",
        help="Replace a value of the scene, as in -D film.samples=16; the value is YAML.",
    )
    return replaced(allow_option(command))


def _allow(ctx: click.Context, option: click.Parameter, folders: tuple[str, ...]) -> None:
    if folders:
        given = [os.environ["ILLUM_ALLOW"]] if os.environ.get("ILLUM_ALLOW") else []
        os.environ["ILLUM_ALLOW"] = os.pathsep.join([*given, *folders])


allow_option = click.option(
    "--allow",
    multiple=True,
    expose_value=False,
    callback=_allow,
    type=click.Path(exists=True, file_okay=False),
    metavar="DIR",
    help="Let scenes read files below DIR too (also: ILLUM_ALLOW).",
)

strict_option = click.option(
    "--strict", is_flag=True, help="Refuse meshes and textures that need repairs, instead of counting them."
)

no_cache_option = click.option(
    "--no-cache",
    "cache",
    flag_value=False,
    default=True,
    help="Neither use nor keep artifacts of other runs; see illum cache.",
)
