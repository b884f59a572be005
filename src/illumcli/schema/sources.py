"""Where the members of an open family are: in this package, in folders that the user names, in others.

Nothing is imported. Entry points of installed packages are read only if a tag is not found elsewhere, or if
all are asked for: reading them takes longer than all the rest.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from illumcli.errors import InputError
from illumcli.records import Value
from illumcli.schema.modules import modules

FAMILIES = (
    "illumcli.models",
    "illumcli.lights",
    "illumcli.visibility.falloffs",
    "illumcli.geometry.shapes",
    "illumcli.scene.curves",
)
"""The packages of the open families."""
FOLDERS = {"illumcli.models": "ILLUM_MODELS"}
"""Family -> the environment variable with folders of its members, one in each file. `--models` sets it, and
no scene can: the files are run."""
NO_MEMBERS = ("test_", "conftest")
"""Beginnings of the names of other files in such a folder."""


class EntryPoint(Value):
    """A member in an installed package."""

    tag: str
    module: str
    package: str
    """Name and version."""
    group: str

    def __str__(self) -> str:
        return f"package {self.package}: entry point {self.tag} of {self.group}"


@cache
def own_tags(package: str) -> tuple[str, ...]:
    """The tags in this package: its modules, without the helpers that begin with an underscore."""
    parent, _, name = package.rpartition(".")
    return modules(f"{folder}/{name}" for folder in import_module(parent).__path__)


def folders(variable: str) -> list[Path]:
    """The absolute paths of the folders that an environment variable names."""
    return [Path(text).absolute() for text in os.environ.get(variable, "").split(os.pathsep) if text]


def source_files(folder: Path) -> list[Path]:
    """The Python files of a folder of members: those at its top, and those in folders of helpers."""
    return sorted([*folder.glob("*.py"), *folder.glob("_*/**/*.py")])


def files(package: str) -> dict[str, Path]:
    """Tag -> file, of the members in folders that the user names.

    Raises
    ------
    InputError
        A folder cannot be read; a tag is in this package too, or in two folders.
    """
    variable = FOLDERS.get(package, "")
    found: dict[str, Path] = {}
    problems: list[str] = []
    for folder in folders(variable):
        try:
            names = modules([str(folder)])
        except OSError as error:
            problems.append(f"{variable}: {folder}: {(error.strerror or str(error)).lower()}; name a folder")
            continue
        for tag in names:
            path = folder / f"{tag}.py"
            if not path.is_file() or tag.startswith(NO_MEMBERS):
                continue
            if tag in own_tags(package):
                problems.append(f"{path}: '{tag}' is a member of {package} already; rename the file")
            elif tag in found and not path.samefile(found[tag]):
                problems.append(f"{path}: '{tag}' is {found[tag]} already; rename one of them")
            else:
                found[tag] = path
    if problems:
        raise InputError(dict.fromkeys(problems))
    return found


def group_of(package: str) -> str:
    """The group of entry points of a family: `illumcli.models`, `illumcli.falloffs`, ..."""
    return f"illumcli.{package.rpartition('.')[2]}"


@cache
def entry_points(package: str) -> Mapping[str, EntryPoint]:
    """Tag -> entry point, of the members in installed packages.

    Raises
    ------
    InputError
        A tag is in this package too, or in two others.
    """
    from importlib.metadata import entry_points as installed

    found: dict[str, EntryPoint] = {}
    problems: list[str] = []
    for each in installed(group=group_of(package)):
        of = f"{each.dist.name} {each.dist.version}" if each.dist else "of no name"
        point = EntryPoint(each.name, each.module, of, each.group)
        if each.name in own_tags(package):
            problems.append(f"{point}: '{each.name}' is a member of {package} already; uninstall it")
        elif each.name in found and found[each.name] != point:
            problems.append(f"{point}: '{each.name}' is in {found[each.name].package} too; uninstall one")
        else:
            found[each.name] = point
    if problems:
        raise InputError(problems)
    return found


def source_of(package: str, tag: str) -> Path | EntryPoint | None:
    """Where a member is that is not in this package; None if there is no such member."""
    own = files(package)
    return own[tag] if tag in own else entry_points(package).get(tag)


def has_member(package: str, tag: Any) -> bool:
    """True if a family has a member of this tag."""
    return tag in own_tags(package) or (isinstance(tag, str) and source_of(package, tag) is not None)


def tags(package: str) -> tuple[str, ...]:
    """All tags of a family, sorted."""
    return tuple(sorted({*own_tags(package), *files(package), *entry_points(package)}))
