"""Which files a scene may read and write: files in the folders near it, and in those of ILLUM_ALLOW."""

from __future__ import annotations

import os
import stat
import unicodedata
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from illumcli.errors import InputError
from illumcli.scene import source
from illumcli.scene.problems import problem_at, problem_lines
from illumcli.scene.scene_file import SceneFile, message_at
from illumcli.scene.source import Node
from illumcli.schema.messages import nearest

PATHS = ("file", "texture", "obscurance")  # keys whose text is a path, besides an object's `mesh`


def resolve(loaded: SceneFile, path: str) -> Path:
    """The file that a path in a scene names: a regular file inside the folders that the scene may read.

    Raises
    ------
    InputError
        No such file, or outside of these folders; with the place in the scene.
    """
    file = file_inside(path, loaded.folder, loaded.roots)
    if isinstance(file, Path):
        return file
    written = ((at, node) for at, node in paths_in(loaded.tree) if node.value == path)
    at, node = next(written, ((), loaded.tree))
    raise InputError(str(problem_at(node.at, at, file)))


def refuse_outside(loaded: SceneFile, number: int, path: Path) -> None:
    """Raise InputError if a name pattern of a scene leads outside of the folders that it may write to.

    Also if the pattern has control characters. Links are followed. A pattern from `-D` may lead anywhere.

    Parameters
    ----------
    number : int
        Index of the pattern in `outputs.files`.
    path : Path
        The file that it names.
    """
    at = ("outputs", "files", number)
    node = loaded.tree.find(at)
    if node is None or node.place.source.startswith("-D "):
        return
    if control := [letter for letter in str(path) if unicodedata.category(letter) == "Cc"]:
        fact = f"character U+{ord(control[0]):04X} is not text; take it out of the name"
        raise InputError(message_at(loaded, at, fact))
    folder = Path(os.path.realpath(path)).parent
    with suppress(OSError):  # a plain name is allowed in any current folder, even in the root folder
        if folder == Path.cwd().resolve():
            return
    if not any(folder.is_relative_to(root) for root in loaded.roots):
        fact = f"{path} lies outside the folders a scene may write to"
        raise InputError(
            message_at(loaded, at, f"{fact}; allow it with --allow {folder}, or name it with -o")
        )


def file_problems(loaded: SceneFile) -> list[str]:
    """One line for each faulty path in the scene."""
    files = [
        (at, node, file_inside(str(node.value), loaded.folder, loaded.roots))
        for at, node in paths_in(loaded.tree)
    ]
    return problem_lines([problem_at(node.at, at, fact) for at, node, fact in files if isinstance(fact, str)])


def paths_in(tree: Node) -> Iterator[tuple[source.Path, Node]]:
    """The nodes of a tree whose text is the path of a file."""
    for path, node in tree.places():
        if isinstance(node.value, str) and is_path(path, node.value):
            yield path, node


def is_path(path: source.Path, text: str) -> bool:
    """True if a text at `path` of a scene is the path of a file; the keys of a curve count as its place."""
    if len(path) > 2 and path[-2] == "keys":
        path = path[:-2]
    key = path[-1] if path else None
    return key in PATHS or (key == "mesh" and "." in text)


def readable_folders(folder: Path) -> tuple[Path, ...]:
    """The scene's folder, its parent, the current one and those of ILLUM_ALLOW; the first three only if they
    are not the root folder."""
    near = [each.resolve() for each in (folder, folder.resolve().parent)]
    with suppress(OSError):  # a current folder that was removed opens nothing
        near.append(Path.cwd().resolve())
    given = [Path(text).resolve() for text in os.environ.get("ILLUM_ALLOW", "").split(os.pathsep) if text]
    return tuple([each for each in near if each != each.parent] + given)


def file_inside(text: str, folder: Path, roots: Sequence[Path]) -> Path | str:
    """The file at `text`, or what is wrong with it. Outside of the roots the disk is not accessed."""
    path = folder / text
    try:
        target = path.resolve()
        if not any(target.is_relative_to(root) for root in roots):
            return f"{path} lies outside the folders a scene may read; allow it with --allow {target.parent}"
        mode = target.stat().st_mode
    except (OSError, ValueError, RuntimeError) as error:
        if isinstance(error, FileNotFoundError):
            return f"no file {path}{_near(path)}"
        return f"{path} cannot be read: {getattr(error, 'strerror', None) or error}"
    return path if stat.S_ISREG(mode) else f"{path} is not a regular file"


def _near(path: Path) -> str:
    """Advice for a file that does not exist: the nearest name in its folder."""
    try:
        names = tuple(sorted(each.name for each in path.parent.iterdir()))
    except OSError:
        return f"; there is no folder {path.parent}"
    near = nearest(path.name, names)
    return f"; did you mean '{near}'?" if near else ""
