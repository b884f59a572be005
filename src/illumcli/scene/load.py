"""Scene files: read, extend, override, validate; every problem at once."""

from __future__ import annotations

import os
import stat
import unicodedata
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from illumcli.errors import InputError
from illumcli.mesh_files import is_mesh_file
from illumcli.records import Value
from illumcli.scene import source
from illumcli.scene.blame import Applied, PlacedFault, blamed
from illumcli.scene.faults import faults
from illumcli.scene.override import Override, assign, parse
from illumcli.scene.references import reference_faults
from illumcli.scene.source import MAX_BYTES, MAX_NODES, Node, Place, Problem
from illumcli.scene.spec import Scene
from illumcli.scene.studio import SETTINGS, STUDIO, Settings, arranged
from illumcli.scene.unused import lacking, unused
from illumcli.schema.description import Description
from illumcli.schema.messages import describe, suggestion

MAX_EXTENDS = 8  # files, one extending the next
MAX_FILES = 64
CHOICES = ("model", "shape", "falloff", "law", "D", "F")  # keys that say what a mapping is
PATHS = ("file", "texture", "obscurance")  # keys whose text is a path, besides an object's `mesh`

D = TypeVar("D", bound=Description)


class SceneFile(Value):
    """A valid scene and what was written to get it."""

    scene: Scene
    path: Path
    folder: Path
    """Where the paths in the scene begin."""
    name: str
    """The file's name without its suffix."""
    overrides: dict[str, Any]
    """Value by path, as given with -D, for patterns of file names."""
    tree: Node = field(repr=False)
    """The scene as written, extended and overridden, with the place of every part."""
    roots: tuple[Path, ...] = field(repr=False)
    """The folders that the scene may read from."""


def load(path: Path, overrides: Sequence[str] = ()) -> SceneFile:
    """The scene in the file `path`, or the studio scene around `path` where that is a mesh.

    Parameters
    ----------
    path : Path
        A scene, or a mesh file.
    overrides : sequence of str
        `PATH=VALUE`, applied in turn; the value is YAML, and `null` takes a part away.

    It may read files in its own folder, the folder above, the current one and those of ILLUM_ALLOW.

    Raises
    ------
    InputError
        Every problem of the scene, by place.
    """
    reading = _Reading(_roots(path.parent))
    changes = [change for text in overrides if (change := parse(text, reading.problems))]
    settings = [change for change in changes if change.steps[0] == SETTINGS]
    if is_mesh_file(path):
        tree = _studio(path, settings, reading)
    else:
        tree = reading.file(path, ())
        way = f"{path} is no mesh without a scene; change its camera and the transforms of its objects"
        reading.problems += [Problem(change.value.place, (), way) for change in settings]
    applied: list[Applied] = []
    if tree is not None:
        for change in changes:
            if change not in settings and (changed := assign(tree, change, reading.problems)):
                applied.append(Applied(change, tree))
                tree = changed
    scene = None if tree is None else _validated(Scene, tree, reading.problems, applied)
    if scene is None or tree is None or reading.problems:
        raise InputError(_lines(reading.problems, overrides))
    values = {change.text: change.value.plain() for change in changes if change.text}
    return SceneFile(scene, path, path.parent, path.stem, values, tree, reading.roots)


def _studio(path: Path, settings: Sequence[Override], reading: _Reading) -> Node | None:
    """The studio's scene around the mesh in the file `path`."""
    tree, said = reading.file(STUDIO, ()), Node({}, Place(str(STUDIO)))
    for change in settings:
        said = assign(said, change, reading.problems) or said
    made = _validated(Settings, said, reading.problems)
    if tree is None or made is None:
        return tree
    mesh = Override(("meshes", "subject", "file"), Node(path.name, Place(str(path))), "")
    return assign(arranged(tree, made.studio), mesh, reading.problems)


def resolve(loaded: SceneFile, path: str) -> Path:
    """The file that a scene means by `path`: regular, and inside the folders it may read from.

    Raises
    ------
    InputError
        With the place in the scene, and the way out.
    """
    found = _inside(path, loaded.folder, loaded.roots)
    if isinstance(found, Path):
        return found
    said = ((at, node) for at, node in _paths(loaded.tree) if node.value == path)
    at, node = next(said, ((), loaded.tree))
    raise InputError(str(_problem(node.at, at, found)))


def refuse_outside(loaded: SceneFile, number: int, path: Path) -> None:
    """Raise InputError where the pattern of this number in `outputs.files` leads to `path`, outside the
    folders that the scene may read from, or holds control characters. Links are followed; a pattern that `-D`
    gives may lead anywhere."""
    at = ("outputs", "files", number)
    node = loaded.tree.find(at)
    if node is None or node.place.source.startswith("-D "):
        return
    if strange := [letter for letter in str(path) if unicodedata.category(letter) == "Cc"]:
        fact = f"character U+{ord(strange[0]):04X} is not text; take it out of the name"
        raise InputError(told(loaded, at, fact))
    folder = Path(os.path.realpath(path)).parent
    with suppress(OSError):  # a plain name is safe wherever the user stands, be it the top of the disk
        if folder == Path.cwd().resolve():
            return
    if not any(folder.is_relative_to(root) for root in loaded.roots):
        fact = f"{path} lies outside the folders a scene may write to"
        raise InputError(told(loaded, at, f"{fact}; allow it with --allow {folder}, or name it with -o"))


def file_problems(loaded: SceneFile) -> list[str]:
    """What `resolve` has against each path in the scene."""
    found = [
        (at, node, _inside(str(node.value), loaded.folder, loaded.roots)) for at, node in _paths(loaded.tree)
    ]
    return _lines([_problem(node.at, at, fact) for at, node, fact in found if isinstance(fact, str)])


def unused_lines(
    loaded: SceneFile, scene: Scene, layers: Collection[str], files: Collection[str]
) -> list[str]:
    """What the scene as written says and what has no effect, a line each; arguments as those of `unused`."""
    found = ((path, fact, loaded.tree.find(path)) for path, fact in unused(scene, layers, files))
    said = ((node.at, path, fact) for path, fact, node in found if node is not None)
    return _lines([_problem(at, path, fact) for at, path, fact in said if at.source != str(STUDIO)])


def lacking_lines(loaded: SceneFile, scene: Scene, layers: Collection[str]) -> list[str]:
    """What pictures of the scene lack, a line each; arguments as those of `lacking`."""
    return [told(loaded, path, fact) for path, fact in lacking(scene, layers)]


def told(loaded: SceneFile, path: source.Path, fact: str) -> str:
    """A line about a part of the scene, with its place."""
    return str(_problem((loaded.tree.find(path) or loaded.tree).at, path, fact))


@dataclass
class _Reading:
    """Scene files being read, one extending the next."""

    roots: tuple[Path, ...]
    problems: list[Problem] = field(default_factory=list)
    files: int = 0
    nodes: int = 0

    def file(self, path: Path, above: tuple[Path, ...]) -> Node | None:
        """The tree of a scene with all it extends; `above` are the files that led here."""
        self.files += 1
        try:
            with path.open("rb") as stream:
                text = stream.read(MAX_BYTES + 1)
        except (OSError, ValueError) as error:
            fact = getattr(error, "strerror", None) or str(error)
            self.problems.append(Problem(Place(str(path)), (), f"cannot be read: {fact}"))
            return None
        tree, problems = source.read(text, str(path))
        self.problems += problems
        if tree is None or not isinstance(tree.value, dict):
            if tree is not None:
                fact = f"a scene is a mapping, this is {describe(tree.value)}; begin with `version: 1`"
                self.problems.append(Problem(tree.place, (), fact))
            return None
        self.nodes += tree.size
        if self.nodes > MAX_NODES:
            self.problems.append(Problem(tree.place, (), f"more than {MAX_NODES} parts with all it extends"))
            return None
        entries = dict(tree.value)
        extends = entries.pop("extends", None)
        own = replace(tree, value=entries)
        if extends is None:
            return own
        base: Node | None = None
        for node in extends.value if isinstance(extends.value, list) else [extends]:
            found = self.base(node, path, (*above, path))
            if found is None:
                return None
            base = found if base is None else merged(base, found)
        return own if base is None else merged(base, own)

    def base(self, node: Node, path: Path, above: tuple[Path, ...]) -> Node | None:
        """The tree of one file that `path` extends, its own paths rewritten from the folder of `path`."""
        if fact := self.against(node, path, above):
            self.problems.append(Problem(node.at, ("extends",), fact))
            return None
        tree = self.file(path.parent / str(node.value), above)
        folder = os.path.dirname(str(node.value))
        return _moved(tree, folder) if tree and folder else tree

    def against(self, node: Node, path: Path, above: tuple[Path, ...]) -> str | None:
        """What is wrong with the file that `path` extends."""
        if not isinstance(node.value, str):
            return f"must be the path of a scene, is {describe(node.value)}"
        found = _inside(node.value, path.parent, self.roots)
        if isinstance(found, str):
            return found
        if any(found.samefile(each) for each in above):
            return f"{node.value} extends itself; take one extends: away"
        if len(above) > MAX_EXTENDS:
            return f"more than {MAX_EXTENDS} files, each extending the next"
        return f"more than {MAX_FILES} files in all" if self.files >= MAX_FILES else None


def merged(base: Node, over: Node) -> Node:
    """`over` on top of `base`: mappings merge, anything else replaces, `null` removes.

    A mapping that says what it is (`model: phong`) replaces one that is something else.
    """
    if not (isinstance(base.value, dict) and isinstance(over.value, dict)):
        return over
    if (kind := _kind(over.value)) and kind != _kind(base.value):
        return over
    entries = dict(base.value)
    for key, node in over.value.items():
        if key in entries and node.value is None:
            del entries[key]
        else:
            entries[key] = merged(entries[key], node) if key in entries else node
    return replace(over, value=entries)


def _kind(entries: Mapping[str, Node]) -> dict[str, Any]:
    """What a mapping says that it is. A mesh or material may have such a key for its name: not text then."""
    said = {key: node.value for key, node in entries.items() if isinstance(node.value, str)}
    return {key: value for key, value in said.items() if key in CHOICES} | {
        key: True for key in ("file", "texture", "vertex") if key in said
    }


def _validated(
    kind: type[D], tree: Node, problems: list[Problem], applied: Sequence[Applied] = ()
) -> D | None:
    """The description that a tree writes, or None after adding what is wrong with it to `problems`."""
    made, found = _judged(kind, tree)
    known = {problem.place for problem in problems}
    problems += [
        fault if isinstance(fault, Problem) else _problem(*fault)
        for fault in blamed(found, tree, applied, lambda before: _judged(kind, before)[1])
        if fault.place not in known
    ]
    return made


def _judged(kind: type[D], tree: Node) -> tuple[D | None, list[PlacedFault]]:
    """The description that a tree writes, or None and what is wrong with it."""
    plain = tree.plain()
    try:
        return kind.model_validate(plain), []
    except ValidationError as error:
        found = [*faults(error, kind, plain), *(reference_faults(plain) if kind is Scene else ())]
    return None, [
        PlacedFault((tree.find(path) or tree).at, path, fact) for path, fact in dict.fromkeys(found)
    ]


def _problem(place: Place, path: source.Path, fact: str) -> Problem:
    """A problem with the part of `path` that its place does not say already: an override names its own."""
    if place.source.startswith("-D "):
        path = path[place.source.partition("=")[0].count(".") + 1 :]
    return Problem(place, path, fact)


def _lines(problems: Sequence[Problem], overrides: Sequence[str] = ()) -> list[str]:
    """One line each, once: files as they were read, by line; then the overrides as they were given."""
    read = [problem.place.source for problem in problems if problem.place.line]
    sources = list(dict.fromkeys([*read, *(f"-D {text}" for text in overrides)]))

    def order(problem: Problem) -> tuple[int, int, int]:
        name, line, column = problem.place
        return sources.index(name) if name in sources else -1, line, column

    return list(dict.fromkeys(str(problem) for problem in sorted(problems, key=order)))


def _paths(tree: Node) -> Iterator[tuple[source.Path, Node]]:
    """The texts of a tree that are paths of files."""
    for path, node in tree.places():
        key = path[-1] if path else None
        if isinstance(node.value, str) and (key in PATHS or (key == "mesh" and "." in node.value)):
            yield path, node


def _moved(tree: Node, folder: str) -> Node:
    """The tree with its paths, written from `folder`, rewritten from the folder above."""
    for path, node in list(_paths(tree)):
        tree = _with(tree, path, replace(node, value=os.path.join(folder, str(node.value))))
    return tree


def _with(tree: Node, path: source.Path, node: Node) -> Node:
    if not path:
        return node
    step, rest = path[0], path[1:]
    if isinstance(tree.value, dict) and isinstance(step, str):
        return replace(tree, value={**tree.value, step: _with(tree.value[step], rest, node)})
    assert isinstance(tree.value, list)
    assert isinstance(step, int)
    parts = list(tree.value)
    parts[step] = _with(parts[step], rest, node)
    return replace(tree, value=parts)


def _roots(folder: Path) -> tuple[Path, ...]:
    """The scene's folder, its parent and the current one, none of them the whole disk; those allowed."""
    near = [each.resolve() for each in (folder, folder.resolve().parent)]
    with suppress(OSError):  # a current folder that was removed opens nothing
        near.append(Path.cwd().resolve())
    given = [Path(text).resolve() for text in os.environ.get("ILLUM_ALLOW", "").split(os.pathsep) if text]
    return tuple([each for each in near if each != each.parent] + given)


def _inside(text: str, folder: Path, roots: Sequence[Path]) -> Path | str:
    """The file at `text`, or what is wrong with it; outside the roots nothing is looked at."""
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
    """The way out of a misspelt name: the nearest name in its folder."""
    try:
        names = tuple(sorted(each.name for each in path.parent.iterdir()))
    except OSError:
        return f"; there is no folder {path.parent}"
    way = suggestion(path.name, names)
    return f"; {way}" if way.startswith("did you mean") else ""
