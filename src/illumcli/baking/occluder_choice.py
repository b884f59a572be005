"""The texts of `--occluders`: which geometry occludes which object of a bake."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from illumcli.errors import InputError
from illumcli.mesh_files import is_mesh_file
from illumcli.records import Value
from illumcli.scene.scene_file import SCENE_SUFFIXES


class OccluderChoice(Value):
    """What occludes an object."""

    objects: tuple[int, ...]  # indices, in ascending order; the object is among them
    files: tuple[Path, ...]


def occluding_files(texts: Sequence[str]) -> tuple[Path, ...]:
    """The mesh and scene files among the texts."""
    values = dict.fromkeys(text.rpartition("=")[2] for text in texts)
    return tuple(Path(value) for value in values if _is_file(value))


def with_files_at(texts: Sequence[str], at: Callable[[Path], Path]) -> tuple[str, ...]:
    """The texts with files at other places."""
    parts = [text.rpartition("=") for text in texts]
    return tuple(
        f"{owner}{separator}{at(Path(value)) if _is_file(value) else value}"
        for owner, separator, value in parts
    )


def occluder_choices(texts: Sequence[str], names: Sequence[str]) -> list[OccluderChoice]:
    """What occludes each object.

    Parameters
    ----------
    texts
        `scene`, `own`, a name of an object or a file: for all objects; after `OBJECT=` for one, instead.
    names
        The objects.

    Raises
    ------
    InputError
        A text names no object or file, or both.
    """
    of_all: list[str] = []
    of_one: dict[str, list[str]] = {}
    for text in texts:
        owner, _, value = text.rpartition("=")
        _refuse_unknown(text, owner, value, names)
        (of_one.setdefault(owner, []) if owner else of_all).append(value)
    return [_choice(of_one.get(name, of_all), index, names) for index, name in enumerate(names)]


def _choice(values: Sequence[str], index: int, names: Sequence[str]) -> OccluderChoice:
    objects = {index, *(names.index(value) for value in values if value in names)}
    if "scene" in values or not values:
        objects = set(range(len(names)))
    return OccluderChoice(tuple(sorted(objects)), occluding_files(values))


def _refuse_unknown(text: str, owner: str, value: str, names: Sequence[str]) -> None:
    objects = ", ".join(names)
    if owner and owner not in names:
        raise InputError(f"--occluders {text}: no object is called {owner}; there are: {objects}")
    is_known = value in ("scene", "own") or _is_file(value)
    if is_known and value in names:
        raise InputError(f"--occluders {value}: an object has that name too; give the object another name")
    if not is_known and value not in names:
        raise InputError(
            f"--occluders {text}: no object of that name, and no mesh or scene file; "
            f"there are: scene, own, {objects}"
        )


def _is_file(value: str) -> bool:
    path = Path(value)
    return is_mesh_file(path) or path.suffix.lower() in SCENE_SUFFIXES
