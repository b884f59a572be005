"""Loads scene files: read, extend, override and validate; all problems are reported at once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from illumcli.errors import InputError
from illumcli.mesh_files import holds_obscurance, is_mesh_file
from illumcli.records import Value
from illumcli.scene.access import readable_folders
from illumcli.scene.animation import AtFrame, Surroundings, TableFiles, at_frame, frames_of
from illumcli.scene.blame import Applied, PlacedFault, blamed
from illumcli.scene.extend import SceneReader
from illumcli.scene.faults import faults
from illumcli.scene.frames import Frames
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
    tables: TableFiles = field(default_factory=TableFiles)
    """Files that its curves name, once they were read."""
    files: tuple[Path, ...] = ()
    """The files of the text itself, read or not."""


def read_text(path: Path) -> SceneText:
    """The text of the scene file `path`; that of the studio scene with it where it is a mesh file."""
    reader = SceneReader(readable_folders(path.parent))
    tree = _studio(path, reader) if is_mesh_file(path) else reader.file(path, ())
    return SceneText(tree, tuple(reader.problems), reader.roots, files=tuple(reader.paths))


def read_frames(path: Path, overrides: Sequence[str] = (), text: SceneText | None = None) -> Frames | None:
    """The frames of the scene in a file; None if it has none, or faulty ones, which `load` reports.

    Parameters are those of `load`.
    """
    ignored: list[Problem] = []
    tree = (text or read_text(path)).tree or Node({}, Place(str(path)))
    for each in overrides:
        if each.lstrip().startswith("frames") and (change := parse(each, ignored)):
            tree = assign(tree, change, ignored) or tree
    return frames_of(tree)


def load(
    path: Path, overrides: Sequence[str] = (), text: SceneText | None = None, frame: int | None = None
) -> SceneFile:
    """The scene in a file at a frame, or the studio scene with the mesh of a mesh file.

    A scene may read files in its own folder, the folder above, the current one and those of ILLUM_ALLOW.

    Parameters
    ----------
    path : Path
        A scene, or a mesh file.
    overrides : sequence of str
        `PATH=VALUE`, applied in turn; the value is YAML, and `null` removes a part.
    text : SceneText, optional
        Of the file, where it was read before: variants of a scene are what it was then.
    frame : int, optional
        Where the scene's curves are evaluated; by default at the first of its frames.

    Raises
    ------
    InputError
        All problems of the scene, ordered by place.
    """
    text = text or read_text(path)
    reader = SceneReader(text.roots)
    changes = [change for text in overrides if (change := parse(text, reader.problems))]
    tree, applied = _changed(path, text, changes, reader)

    # Evaluate its curves, and validate the tree.
    surroundings = Surroundings(path.parent, reader.roots, text.tables)

    def animated(tree: Node) -> AtFrame:
        return at_frame(tree, frame, surroundings)

    now = None if tree is None else animated(tree)
    scene = None if now is None else _validated(Scene, now, reader.problems, applied, animated)
    if scene is None or now is None or reader.problems:
        raise InputError(problem_lines(reader.problems, overrides))
    values = {change.text: change.value.plain() for change in changes if change.text}
    return SceneFile(
        scene, path, path.parent, path.stem, values, now.tree, reader.roots, now.frame, now.varying
    )


def written(path: Path, overrides: Sequence[str], text: SceneText) -> Node:
    """The tree of a valid scene or mesh with overrides as a file would have it: curves are not evaluated."""
    reader = SceneReader(text.roots)
    changes = [change for text in overrides if (change := parse(text, reader.problems))]
    tree, _ = _changed(path, text, changes, reader)
    if tree is None or reader.problems:
        raise InputError(problem_lines(reader.problems, overrides))
    return tree


def _changed(
    path: Path, text: SceneText, changes: Sequence[Override], reader: SceneReader
) -> tuple[Node | None, list[Applied]]:
    """The tree of a scene or mesh with changes, and each change with the tree before it."""
    # The tree of the file, or of the studio with the mesh.
    settings = [change for change in changes if change.steps[0] == SETTINGS]
    if is_mesh_file(path):
        tree = _arranged(text.tree, settings, reader)
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
    return tree, applied


def _studio(path: Path, reader: SceneReader) -> Node | None:
    """The tree of the studio scene with the mesh file `path`."""
    if (tree := reader.file(STUDIO, ())) is None:
        return None
    mesh = Override(("meshes", "subject", "file"), Node(path.name, Place(str(path))), "")
    tree = assign(tree, mesh, reader.problems) or tree
    if not holds_obscurance(path):
        return tree
    baked = Override(("meshes", "subject", "obscurance"), Node(path.name, Place(str(STUDIO))), "")
    return assign(tree, baked, reader.problems)


def _arranged(tree: Node | None, settings: Sequence[Override], reader: SceneReader) -> Node | None:
    """The tree of the studio scene after its settings."""
    given = Node({}, Place(str(STUDIO)))
    for change in settings:
        given = assign(given, change, reader.problems) or given
    studio_settings = _validated(Settings, AtFrame(given, 0), reader.problems)
    return tree if tree is None or studio_settings is None else arranged(tree, studio_settings.studio)


def _validated(
    kind: type[D],
    now: AtFrame,
    problems: list[Problem],
    applied: Sequence[Applied] = (),
    animated: Callable[[Node], AtFrame] = lambda tree: AtFrame(tree, 0),
) -> D | None:
    """The description that a tree describes; None if it has faults, which are added to `problems`."""
    description, tree_faults = _judged(kind, now)
    known = {problem.place for problem in (*problems, *now.problems)}
    problems += now.problems
    problems += [
        fault if isinstance(fault, Problem) else problem_at(*fault)
        for fault in blamed(tree_faults, now.tree, applied, lambda before: _judged(kind, animated(before))[1])
        if fault.place not in known
    ]
    return description


def _judged(kind: type[D], now: AtFrame) -> tuple[D | None, list[PlacedFault]]:
    """The description that a tree describes, or None and its faults."""
    plain = now.tree.plain()
    try:
        return kind.model_validate(plain), []
    except ValidationError as error:
        tree_faults = [*faults(error, kind, plain), *(reference_faults(plain) if kind is Scene else ())]
    return None, [
        PlacedFault((now.tree.find(path) or now.tree).at, path, now.said(path, fact))
        for path, fact in dict.fromkeys(tree_faults)
        if not any(path[: len(faulty)] == faulty for faulty in now.faulty)
    ]
