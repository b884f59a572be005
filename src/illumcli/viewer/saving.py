"""What a window shows, to keep: a scene that extends its original, and a command that renders it."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from illumcli.errors import InputError, OutputError
from illumcli.files.atomic import os_errors_as_output_errors, write_text
from illumcli.files.outputs import refuse_unwritable
from illumcli.mesh_files import is_mesh_file
from illumcli.scene.access import file_problems, readable_folders
from illumcli.scene.extend import SceneReader, kind_of, merged, moved
from illumcli.scene.load import SceneText, load, written
from illumcli.scene.problems import problem_lines
from illumcli.scene.scene_file import SCENE_SUFFIXES
from illumcli.scene.source import Node, Place
from illumcli.scene.yaml_text import block


def command_text(path: Path, overrides: Sequence[str], words: Sequence[str] = ()) -> str:
    """The command that renders a scene with overrides, for a POSIX shell; `words` are its other options."""
    scene = f"./{path}" if str(path).startswith("-") else str(path)
    changes = [word for override in overrides for word in ("-D", override)]
    return shlex.join(["illum", "render", scene, *changes, *words])


def refuse_elsewhere(target: Path, folder: Path) -> None:
    """Raise InputError if a file is not in a folder or below; links are followed."""
    if not target.resolve().is_relative_to(folder.resolve()):
        fact = (
            f"{target}: the page is open to other machines, so it saves in {folder.resolve()} or below alone"
        )
        raise InputError(f"{fact}; give a name there")


def save(target: Path, path: Path, overrides: Sequence[str], text: SceneText, replace: bool = False) -> None:
    """Write a scene or mesh with overrides as a scene of its own, whole or not at all.

    Parameters
    ----------
    target : Path
        The file to write.
    path : Path
        The scene or mesh file.
    text : SceneText
        Of the scene file, as it was read.
    replace : bool
        True to replace another file.

    Raises
    ------
    InputError
        The name is not that of another scene, or a scene there could not read what this one does.
    OutputError
        Another file is there and `replace` is False, or it cannot be written.
    """
    if target.suffix not in SCENE_SUFFIXES:
        raise InputError(f"{target}: a scene's name ends in {' or '.join(SCENE_SUFFIXES)}; give such a name")
    if not target.parent.is_dir():
        raise InputError(f"{target}: there is no folder {target.parent}; give another name")
    if path.exists() and target.exists() and target.samefile(path):
        raise InputError(f"{target}: is the scene itself, which the new one extends; give another name")
    content = saved_text(target, path, overrides, text)
    with os_errors_as_output_errors(str(target)):
        if not replace:
            if target.is_symlink() and not target.exists():
                raise OutputError(f"{target}: is a link to nothing; replace it, or give another name")
            if target.is_file() and target.read_bytes() != content.encode():
                raise OutputError(f"{target}: a different file is there; replace it, or give another name")
        refuse_unwritable(target)
    write_text(target, content)


def saved_text(target: Path, path: Path, overrides: Sequence[str], text: SceneText) -> str:
    """The scene that `save` writes: that of a scene file extends it and has what was changed alone, that of a
    mesh has all of the studio's.

    Raises
    ------
    InputError
        As for `save`.
    """
    # The folder of the original as seen from that of the new scene.
    base_folder, folder = (Path(os.path.realpath(each.parent)) for each in (path, target))
    original = os.path.relpath(base_folder / path.name, folder)
    tree = _seen_from(original, written(path, overrides, text))
    if is_mesh_file(path) or text.tree is None:
        content = f"# {path.name} as illum view showed it.\n{block(tree.plain())}"
    else:
        changes = difference(_seen_from(original, text.tree), tree)
        content = f"# {path.name} with the changes made in illum view.\n"
        content += block({"extends": original, **changes})

    # What will be read from there is what was meant.
    reader = SceneReader(readable_folders(target.parent))
    read = reader.text(content.encode(), target, ())
    if read is None or reader.problems:
        raise InputError(problem_lines(reader.problems))
    assert _equal(read, tree), content
    loaded = load(target, (), SceneText(read, (), reader.roots, text.tables))
    if problems := file_problems(loaded):
        raise InputError(problems)
    return content


def _seen_from(original: str, tree: Node) -> Node:
    """A tree whose paths lead from the folder from which `original` does."""
    folder = os.path.dirname(original)
    return moved(tree, folder) if folder else tree


def difference(base: Node, new: Node) -> Any:
    """What must be merged into `base` to make it `new`, as a plain value; null removes a key."""
    if not (isinstance(base.value, dict) and isinstance(new.value, dict)):
        return new.plain()
    removed = {key: None for key in base.value if key not in new.value}
    parts = {
        key: difference(base.value[key], node) if key in base.value else node.plain()
        for key, node in new.value.items()
        if key not in base.value or not _equal(base.value[key], node)
    }
    if _equal(merged(base, _node(parts | removed)), new):
        return parts | removed
    return new.plain() | (removed if kind_of(new.value) == kind_of(base.value) else {})


def _node(value: Any) -> Node:
    """A plain value as a part of a scene that is in no file."""
    place = Place("")
    if isinstance(value, Mapping):
        return Node({key: _node(part) for key, part in value.items()}, place)
    return Node([_node(part) for part in value] if isinstance(value, list) else value, place)


def _equal(a: Node, b: Node) -> bool:
    """True for the same values; true is no 1."""
    if isinstance(a.value, dict) and isinstance(b.value, dict):
        x, y = a.value, b.value
        return x.keys() == y.keys() and all(_equal(part, y[key]) for key, part in x.items())
    if isinstance(a.value, list) and isinstance(b.value, list):
        return len(a.value) == len(b.value) and all(map(_equal, a.value, b.value))
    return a.value == b.value and isinstance(a.value, bool) == isinstance(b.value, bool)
