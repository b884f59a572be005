"""The files that a unit of work reads, and copies of them for workers that do not share a file system."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path

from illumcli.baking.occluder_choice import occluding_files
from illumcli.baking.settings import BakeJob
from illumcli.cache.fingerprint import file_digest
from illumcli.commands.unit import Unit
from illumcli.errors import InputError
from illumcli.files.atomic import write_bytes
from illumcli.gonioreflectometer.work import MeasureRow
from illumcli.mesh_files import companions, is_mesh_file
from illumcli.scene.access import file_inside
from illumcli.scene.load import SceneText, load, read_text
from illumcli.scene.override import parse
from illumcli.schema.sources import folders, source_files


class Inputs:
    """Finds and hashes the files of units, and of models of the user; each is read once."""

    def __init__(self) -> None:
        self._digests: dict[Path, str] = {}
        self._beside: dict[Path, list[Path]] = {}
        self._texts: dict[Path, SceneText] = {}

    def of_all(self, units: Iterable[Unit]) -> dict[Path, str]:
        """Absolute path -> hash, of every file that units read.

        Raises
        ------
        InputError
            The scene has a fault.
        """
        own = [path for folder in folders("ILLUM_MODELS") for path in source_files(folder)]
        paths = dict.fromkeys([*own, *(path for unit in units for path in self._paths(unit))])
        return {path: self._digest(path) for path in paths if path.is_file()}

    def _paths(self, unit: Unit) -> Iterator[Path]:
        """The files of all scenes and meshes that a unit reads."""
        if isinstance(unit, MeasureRow):
            yield from _absolute(unit.files())
            return
        yield from self._paths_of(scene_of(unit), unit)
        if isinstance(unit, BakeJob):
            for path in occluding_files(unit.settings.occluders):
                yield from self._paths_of(path, unit)

    def _paths_of(self, main: Path, unit: Unit) -> Iterator[Path]:
        """A scene, those that it extends, and every file that a text in it names, with its companions."""
        if main not in self._texts:
            self._texts[main] = read_text(main)
        text = self._texts[main]
        loaded = load(main, unit.options.overrides, text, getattr(unit, "frame", None))
        given = [change.value for each in unit.options.overrides if (change := parse(each, []))]
        trees = (text.tree, loaded.tree, *given)
        nodes = [node for tree in trees if tree is not None for _, node in tree.places()]
        words = dict.fromkeys(node.value for node in nodes if isinstance(node.value, str))
        named = [file_inside(word, loaded.folder, loaded.roots) for word in words]
        yield from _absolute([main, *(Path(node.place.source) for node in nodes)])
        for path in _absolute(each for each in named if isinstance(each, Path)):
            yield path
            if is_mesh_file(path):
                if path not in self._beside:
                    self._beside[path] = list(_absolute(companions(path)))
                yield from self._beside[path]

    def _digest(self, path: Path) -> str:
        if path not in self._digests:
            self._digests[path] = file_digest(path)
        return self._digests[path]


def scene_of(unit: Unit) -> Path:
    """The scene, mesh or surface of a unit."""
    path: Path = getattr(unit, "scene", None) or unit.path  # type: ignore[union-attr]
    return path


def _absolute(paths: Iterable[Path]) -> Iterator[Path]:
    return (Path(os.path.abspath(path)) for path in paths)


class Mirror:
    """Copies of another machine's files below a folder, each at its absolute path there.

    A process whose current folder is the copy of the other's finds everything by the same relative names.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._known: dict[Path, str] = {}

    def at(self, path: str | Path) -> Path:
        """The place of an absolute path."""
        return self.root / Path(path).relative_to("/")

    def lacking(self, digests: Mapping[Path, str]) -> list[Path]:
        """The files that are not here with this content."""
        return [path for path, digest in digests.items() if self._known.get(path) != digest]

    def add(self, contents: Mapping[Path, bytes]) -> None:
        """Write copies."""
        for path, content in contents.items():
            place = self.at(path)
            place.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(place, content)
            self._known[path] = file_digest(place)

    def enter(self, folder: str) -> None:
        """Make the copy of a folder the current one, and let scenes read every copy."""
        place = self.at(folder)
        place.mkdir(parents=True, exist_ok=True)
        os.chdir(place)
        os.environ["ILLUM_ALLOW"] = str(self.root)


def is_shared(digests: Mapping[Path, str]) -> bool:
    """True if files of this content are at these paths, as on a file system that machines share."""
    for path, digest in digests.items():
        with suppress(InputError):
            if file_digest(path) == digest:
                continue
        return False
    return True
