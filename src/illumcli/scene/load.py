"""Loads scene files: read, extend, override and validate; all problems are reported at once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from illumcli.errors import InputError
from illumcli.mesh_files import is_mesh_file
from illumcli.records import Value
from illumcli.scene.access import readable_folders
from illumcli.scene.blame import Applied, PlacedFault, blamed
from illumcli.scene.extend import SceneReader
from illumcli.scene.faults import faults
from illumcli.scene.override import Override, assign, parse
from illumcli.scene.problems import problem_at, problem_lines
from illumcli.scene.references import reference_faults
from illumcli.scene.scene_file import SceneFile
from illumcli.scene.source import Node, Place, Problem
from illumcli.scene.spec import Scene
from illumcli.scene.studio import SETTINGS, STUDIO, Settings, arranged
from illumcli.schema.description import Description

D = TypeVar("D", bound=Description)


class SceneText(Value):
    """What is written in the file of a scene and in those it extends, before any override."""

    tree: Node | None
    problems: tuple[Problem, ...]
    roots: tuple[Path, ...]


def read_text(path: Path) -> SceneText:
    """The text of the scene file `path`; nothing is written where that is a mesh file."""
    reader = SceneReader(readable_folders(path.parent))
    tree = None if is_mesh_file(path) else reader.file(path, ())
    return SceneText(tree, tuple(reader.problems), reader.roots)


def load(path: Path, overrides: Sequence[str] = (), text: SceneText | None = None) -> SceneFile:
    """The scene in a file, or the studio scene with the mesh of a mesh file.

    A scene may read files in its own folder, the folder above, the current one and those of ILLUM_ALLOW.

    Parameters
    ----------
    path : Path
        A scene, or a mesh file.
    overrides : sequence of str
        `PATH=VALUE`, applied in turn; the value is YAML, and `null` removes a part.
    text : SceneText, optional
        Of the file, where it was read before: variants of a scene are what it was then.

    Raises
    ------
    InputError
        All problems of the scene, ordered by place.
    """
    text = text or read_text(path)
    reader = SceneReader(text.roots)
    changes = [change for text in overrides if (change := parse(text, reader.problems))]
    settings = [change for change in changes if change.steps[0] == SETTINGS]

    # The tree of the file, or of the studio with the mesh.
    if is_mesh_file(path):
        tree = _studio(path, settings, reader)
    else:
        tree = text.tree
        reader.problems += text.problems
        fact = f"{path} is not a mesh file; change its camera and the transforms of its objects"
        reader.problems += [Problem(change.value.place, (), fact) for change in settings]

    # Overrides in turn, each with the tree before it, so that a fault can be attributed to one.
    applied: list[Applied] = []
    if tree is not None:
        for change in changes:
            if change not in settings and (changed := assign(tree, change, reader.problems)):
                applied.append(Applied(change, tree))
                tree = changed

    # Validate the tree.
    scene = None if tree is None else _validated(Scene, tree, reader.problems, applied)
    if scene is None or tree is None or reader.problems:
        raise InputError(problem_lines(reader.problems, overrides))
    values = {change.text: change.value.plain() for change in changes if change.text}
    return SceneFile(scene, path, path.parent, path.stem, values, tree, reader.roots)


def _studio(path: Path, settings: Sequence[Override], reader: SceneReader) -> Node | None:
    """The tree of the studio scene with the mesh file `path`."""
    tree, given = reader.file(STUDIO, ()), Node({}, Place(str(STUDIO)))
    for change in settings:
        given = assign(given, change, reader.problems) or given
    studio_settings = _validated(Settings, given, reader.problems)
    if tree is None or studio_settings is None:
        return tree
    mesh = Override(("meshes", "subject", "file"), Node(path.name, Place(str(path))), "")
    return assign(arranged(tree, studio_settings.studio), mesh, reader.problems)


def _validated(
    kind: type[D], tree: Node, problems: list[Problem], applied: Sequence[Applied] = ()
) -> D | None:
    """The description that a tree describes; None if it has faults, which are added to `problems`."""
    description, tree_faults = _judged(kind, tree)
    known = {problem.place for problem in problems}
    problems += [
        fault if isinstance(fault, Problem) else problem_at(*fault)
        for fault in blamed(tree_faults, tree, applied, lambda before: _judged(kind, before)[1])
        if fault.place not in known
    ]
    return description


def _judged(kind: type[D], tree: Node) -> tuple[D | None, list[PlacedFault]]:
    """The description that a tree describes, or None and its faults."""
    plain = tree.plain()
    try:
        return kind.model_validate(plain), []
    except ValidationError as error:
        tree_faults = [*faults(error, kind, plain), *(reference_faults(plain) if kind is Scene else ())]
    return None, [
        PlacedFault((tree.find(path) or tree).at, path, fact) for path, fact in dict.fromkeys(tree_faults)
    ]
