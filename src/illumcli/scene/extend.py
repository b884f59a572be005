"""Scenes that extend others: reads the files and merges their trees."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from illumcli.scene import source
from illumcli.scene.access import file_inside, paths_in
from illumcli.scene.curves import CURVES
from illumcli.scene.source import MAX_BYTES, MAX_NODES, Node, Place, Problem
from illumcli.schema.messages import describe
from illumcli.schema.sources import has_member

MAX_EXTENDS = 8  # length of a chain of files, each of which extends the next
MAX_FILES = 64
CHOICES = ("model", "shape", "falloff", "law", "D", "F")  # keys that are the tag of a mapping


@dataclass
class SceneReader:
    """Reads a scene file and the files that it extends; collects the problems of all."""

    roots: tuple[Path, ...]
    problems: list[Problem] = field(default_factory=list)
    paths: list[Path] = field(default_factory=list)
    """The files that were read, or should have been."""
    nodes: int = 0

    def file(self, path: Path, above: tuple[Path, ...]) -> Node | None:
        """The tree of a scene file, merged with all that it extends; `above` are the files that extend it."""
        self.paths.append(path)
        try:
            with path.open("rb") as stream:
                text = stream.read(MAX_BYTES + 1)
        except (OSError, ValueError) as error:
            fact = getattr(error, "strerror", None) or str(error)
            self.problems.append(Problem(Place(str(path)), (), f"cannot be read: {fact}"))
            return None
        return self.text(text, path, above)

    def text(self, text: bytes, path: Path, above: tuple[Path, ...]) -> Node | None:
        """The same of the text of a file that is, or will be, at `path`."""
        # Parse it, within the limits for all files together.
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

        # Merge the scenes that it extends in turn, and this one on top.
        entries = dict(tree.value)
        extends = entries.pop("extends", None)
        tree = replace(tree, value=entries)
        if extends is None:
            return tree
        base: Node | None = None
        for node in extends.value if isinstance(extends.value, list) else [extends]:
            extended = self.base(node, path, (*above, path))
            if extended is None:
                return None
            base = extended if base is None else merged(base, extended)
        return tree if base is None else merged(base, tree)

    def base(self, node: Node, path: Path, above: tuple[Path, ...]) -> Node | None:
        """The tree of one file that `path` extends, with its paths made relative to the folder of `path`."""
        if fact := self.refusal(node, path, above):
            self.problems.append(Problem(node.at, ("extends",), fact))
            return None
        tree = self.file(path.parent / str(node.value), above)
        folder = os.path.dirname(str(node.value))
        return moved(tree, folder) if tree and folder else tree

    def refusal(self, node: Node, path: Path, above: tuple[Path, ...]) -> str | None:
        """Why the file that `path` extends is refused; None if it is not."""
        if not isinstance(node.value, str):
            return f"must be the path of a scene, is {describe(node.value)}"
        file = file_inside(node.value, path.parent, self.roots)
        if isinstance(file, str):
            return file
        if any(file.samefile(each) for each in above if each.exists()):  # the text may be of a new file
            return f"{node.value} extends itself; remove one extends:"
        if len(above) > MAX_EXTENDS:
            return f"more than {MAX_EXTENDS} files, each extending the next"
        return f"more than {MAX_FILES} files in all" if len(self.paths) >= MAX_FILES else None


def merged(base: Node, over: Node) -> Node:
    """`over` on top of `base`: mappings merge, anything else replaces, `null` removes.

    A mapping with another tag (`model: phong`) replaces the one below instead of merging with it.
    """
    if not (isinstance(base.value, dict) and isinstance(over.value, dict)):
        return over
    if (kind := kind_of(over.value)) and kind != kind_of(base.value):
        return over
    entries = dict(base.value)
    for key, node in over.value.items():
        if key in entries and node.value is None:
            del entries[key]
        else:
            entries[key] = merged(entries[key], node) if key in entries else node
    return replace(over, value=entries)


def kind_of(entries: Mapping[str, Node]) -> dict[str, Any]:
    """The tag of a mapping, from its keys; a mesh or material that is named like a tag is not text."""
    texts = {key: node.value for key, node in entries.items() if isinstance(node.value, str)}
    kind: dict[str, Any] = {key: value for key, value in texts.items() if key in CHOICES}
    if "curve" in texts and has_member(CURVES, texts["curve"]):
        return kind | {"curve": texts["curve"]}
    return kind | {key: True for key in ("file", "texture", "vertex") if key in texts}


def moved(tree: Node, folder: str) -> Node:
    """The tree with its paths, which are relative to `folder`, made relative to the folder above."""
    for path, node in list(paths_in(tree)):
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
