"""The inputs of a bake that are named by their folders."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from illumcli.baking.files import SUFFIXES, baked_contents
from illumcli.errors import IllumError, InputError
from illumcli.mesh_files import is_mesh_file
from illumcli.records import Value
from illumcli.scene.scene_file import SCENE_SUFFIXES

SHOWN = 5
"""Files of a folder that are named for one reason to pass them over."""


class BakeInputs(Value):
    """The inputs of a bake, and a line for each reason why files of its folders are not among them."""

    paths: tuple[Path, ...]
    passed_over: tuple[str, ...] = ()


def with_folders(inputs: Sequence[Path]) -> BakeInputs:
    """The inputs, with the mesh files of each folder, by name, in its place.

    Raises
    ------
    InputError
        Folders without a mesh file, and folders that cannot be read.
    """
    paths: list[Path] = []
    lines: list[str] = []
    problems: list[str] = []
    for path in inputs:
        if not path.is_dir():
            paths.append(path)
            continue
        try:
            meshes, others = _sorted_out(path)
        except OSError as error:
            problems.append(f"{path}: cannot be read ({error.strerror}); change its permissions")
            continue
        passed_over = [f"{path}: passed over {_listed(names)}: {why}" for why, names in others.items()]
        if meshes:
            paths += meshes
            lines += passed_over
        else:
            fact = f"{path}: has no mesh files; name a folder that has some"
            problems.append("\n".join([fact, *passed_over]))
    if problems:
        raise InputError(problems)
    return BakeInputs(tuple(paths), tuple(lines))


def _sorted_out(folder: Path) -> tuple[list[Path], dict[str, list[str]]]:
    """The mesh files of a folder, and the names of its other entries by the reason to pass them over."""
    meshes: list[Path] = []
    others: defaultdict[str, list[str]] = defaultdict(list)
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        reason = _reason(path)
        if reason is None:
            meshes.append(path)
        else:
            others[reason].append(path.name)
    return meshes, others


def _reason(path: Path) -> str | None:
    """Why an entry of a folder is no input; None if it is one."""
    if path.is_dir():
        return "folders in folders are not searched, name them"
    if path.suffix.lower() in SCENE_SUFFIXES:
        return "scenes are baked if they are named"
    if not is_mesh_file(path):
        return "no mesh files"
    return "baked by illum" if path.suffix.lower() in SUFFIXES and _is_baked(path) else None


def _is_baked(path: Path) -> bool:
    try:
        return bool(baked_contents(path))
    except IllumError:
        return False


def _listed(names: Sequence[str]) -> str:
    more = len(names) - SHOWN
    return ", ".join(names[:SHOWN]) + (f" and {more} more" if more > 0 else "")
