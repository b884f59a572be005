"""Scenes that Python hands over: paths, mappings, descriptions, with meshes as arrays among their values."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from illumcli.api.choices import plain_number
from illumcli.api.meshes import MeshLike, is_mesh, write_mesh
from illumcli.errors import InputError, LimitError
from illumcli.scene.access import is_path
from illumcli.scene.spec import Scene
from illumcli.schema.annotations import is_tag
from illumcli.schema.description import Description

AnyScene: TypeAlias = "str | os.PathLike[str] | Mapping[str, Any] | Scene | MeshLike"
"""Path of a scene or mesh file; a scene as a mapping with the keys of the YAML or a description; a mesh."""
Overrides: TypeAlias = "Mapping[str, Any] | Sequence[str] | str | None"
"""Values by path, ``{"materials.clay.sigma": 0.3}``, or `PATH=VALUE` as ``illum render -D`` takes them."""

NAME = "scene.yaml"


def written(scene: Mapping[str, Any] | Scene, folder: Path) -> Path:
    """Write a scene to `folder`, beside its meshes; its paths are relative to the current folder.

    Raises
    ------
    InputError
        A value that no scene can have, such as an object of an unknown class.
    """
    path = folder / NAME
    path.write_text(_yaml(_plain(scene, (), folder)), encoding="utf-8")
    return path


def file_of(scene: AnyScene, folder: Path) -> Path:
    """The file of a scene or mesh; a mapping, description or mesh that is no file is written to `folder`.

    Raises
    ------
    InputError
        Something else, or a value that no scene can have.
    """
    if not isinstance(scene, Scene) and is_mesh(scene):
        return write_mesh(scene, folder)
    if isinstance(scene, Mapping | Scene):
        return written(scene, folder)
    if not isinstance(scene, str | os.PathLike):
        kinds = "a path, a mapping with the keys of a scene or with a mesh's arrays, or an illumcli.Scene"
        raise InputError(f"scene: must be {kinds}, is of type {type(scene).__name__}")
    return Path(os.fspath(scene))


def override_texts(overrides: Overrides, folder: Path) -> tuple[str, ...]:
    """Overrides as `PATH=VALUE`.

    Raises
    ------
    InputError
        They are neither a mapping nor texts, or have a value that no scene can have.
    """
    if isinstance(overrides, str):
        return (overrides,)
    if not isinstance(overrides, Mapping):
        texts = overrides if isinstance(overrides, Sequence) else () if overrides is None else (overrides,)
        for each in texts:
            if not isinstance(each, str):
                kinds = "a mapping from paths to values, or texts as PATH=VALUE"
                raise InputError(f"overrides: must be {kinds}, is of type {type(each).__name__}")
        return tuple(texts)
    for path in overrides:
        if not isinstance(path, str):
            raise InputError(f"overrides: a path must be text, is {path!r}; write it as 'film.width'")
    return tuple(
        f"{path}={_yaml(_plain(value, tuple(path.split('.')), folder))}" for path, value in overrides.items()
    )


def given_keys(part: Description) -> dict[str, Any]:
    """The keys of a description that were given, and its tag."""
    cls = type(part)
    return {name: value for name, value in part if name in part.model_fields_set or is_tag(cls, name)}


def _yaml(value: Any) -> str:
    """A value as JSON, which YAML reads."""
    return json.dumps(value, ensure_ascii=False)


def _plain(value: Any, path: tuple[str | int, ...], folder: Path) -> Any:
    """A value as the YAML of a scene has it: meshes as files, arrays as lists, paths from the root folder."""
    if not isinstance(value, Description) and is_mesh(value):
        return {"file": str(write_mesh(value, folder))}
    place = ".".join(map(str, path))
    match value:
        case Description():
            return _plain(given_keys(value), path, folder)
        case Mapping():
            return {str(key): _plain(part, (*path, str(key)), folder) for key, part in value.items()}
        case float() | np.floating() if not np.isfinite(value):
            raise InputError(f"scene: {place}: must be a finite number, is {value}")
        case np.ndarray() if value.dtype.kind == "f" and not np.isfinite(value).all():
            raise InputError(f"scene: {place}: must be finite numbers, and some are not")
        case np.ndarray():
            return value.tolist()
        case float() | np.generic():
            return plain_number(value)
        case list() | tuple():
            return [_plain(part, (*path, number), folder) for number, part in enumerate(value)]
        case os.PathLike():
            return os.path.abspath(value)
        case str() if is_path(path, value):
            return os.path.abspath(value)
        case str() | bool() | int() | None:
            return value
    raise InputError(f"scene: {place}: a scene holds no {type(value).__name__}; give numbers, text or lists")


@contextmanager
def named_scene(folder: Path) -> Iterator[None]:
    """Call the scene file of a temporary folder `scene` in errors, and its mesh files `mesh`."""
    try:
        yield
    except LimitError as error:
        raise LimitError(str(error).replace(str(folder / NAME), "scene")) from None
    except InputError as error:
        own = re.compile(rf"{re.escape(str(folder / NAME))}(:\d+:\d+)?")
        mesh = re.compile(rf"{re.escape(str(folder))}/mesh-[0-9a-f]+\.ply")
        problems = [mesh.sub("mesh", own.sub("scene", problem)) for problem in error.problems]
        raise InputError(problems) from None


def without_folder(value: Any, folder: Path) -> Any:
    """A report, whose texts name the files of a temporary folder without it."""
    match value:
        case str():
            return value.replace(f"{folder}{os.sep}", "")
        case Mapping():
            return {without_folder(key, folder): without_folder(each, folder) for key, each in value.items()}
        case tuple() | list():
            return type(value)(without_folder(each, folder) for each in value)
    return value
