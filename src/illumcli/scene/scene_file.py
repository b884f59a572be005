"""A scene that was read: its description, and the tree of the file that it comes from."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import field
from pathlib import Path
from typing import Any

from illumcli.records import Value
from illumcli.scene import source
from illumcli.scene.problems import problem_at, problem_lines
from illumcli.scene.source import Node
from illumcli.scene.spec import Scene
from illumcli.scene.studio import STUDIO
from illumcli.scene.unused import lacking, unused

SCENE_SUFFIXES = (".yaml", ".yml")


class SceneFile(Value):
    """A valid scene, with the file and overrides that it comes from."""

    scene: Scene
    path: Path
    folder: Path
    """The folder that paths in the scene are relative to."""
    name: str
    """The file's name without its suffix."""
    overrides: dict[str, Any]
    """Value by path, as given with -D, for patterns of file names."""
    tree: Node = field(repr=False)
    """The file's tree after extension, overrides and curves, with the place of every node."""
    roots: tuple[Path, ...] = field(repr=False)
    """The folders that the scene may read from."""
    frame: int = 0
    """The frame that the scene's curves were evaluated at."""
    varying: tuple[source.Path, ...] = field(default=(), repr=False)
    """The paths of the values that vary with the frame."""


def unused_lines(
    loaded: SceneFile, scene: Scene, layers: Collection[str], files: Collection[str]
) -> list[str]:
    """One line for each key in the scene that has no effect; arguments as of `unused`."""
    parts = ((path, fact, loaded.tree.find(path)) for path, fact in unused(scene, layers, files))
    written = ((node.at, path, fact) for path, fact, node in parts if node is not None)
    return problem_lines(
        [problem_at(at, path, fact) for at, path, fact in written if at.source != str(STUDIO)]
    )


def lacking_lines(loaded: SceneFile, scene: Scene, layers: Collection[str]) -> list[str]:
    """A line if images of the scene would be empty or black; arguments as of `lacking`."""
    return [message_at(loaded, path, fact) for path, fact in lacking(scene, layers)]


def message_at(loaded: SceneFile, path: source.Path, fact: str) -> str:
    """A message about a part of the scene, with its place."""
    return str(problem_at((loaded.tree.find(path) or loaded.tree).at, path, fact))
