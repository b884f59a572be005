"""The record of a shard, for `illum merge`: all units of the command, and what became of its own."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

from illumcli import __version__
from illumcli.cache.fingerprint import digest
from illumcli.commands.options import Shard
from illumcli.errors import InputError
from illumcli.files.atomic import write_text
from illumcli.files.reports import sealed_json
from illumcli.files.seal import is_sealed
from illumcli.records import Value

PATTERN = "shard-*-of-*.json"


class ShardUnit(Value):
    """A unit of the whole command."""

    name: str
    files: tuple[str, ...]
    """Paths relative to the folder of the command's files."""
    shard: int
    about: Mapping[str, Any] = field(default_factory=dict)
    """What the files about all units say of it."""


class ShardResult(Value):
    """What became of a unit."""

    files: Mapping[str, str] = field(default_factory=dict)
    """Path -> content hash."""
    report: Mapping[str, Any] | None = None
    error: str = ""


class ShardRecord(Value):
    """A shard: the whole command, the same in all its shards, and the results of this one."""

    command: str
    shard: Shard
    settings: Mapping[str, Any]
    """The files to write about all units."""
    units: tuple[ShardUnit, ...]
    results: Mapping[int, ShardResult] = field(default_factory=dict)
    """By the index of a unit; of this shard's units alone."""
    version: str = __version__

    @property
    def whole(self) -> str:
        """Hash of the command that this is a shard of."""
        units = [vars(unit) for unit in self.units]
        return digest(json.dumps([self.version, self.command, self.shard.count, self.settings, units]))


def folder_of(files: Iterable[Path]) -> Path:
    """The folder below which all files are, relative to the current one where it is below that.

    Raises
    ------
    InputError
        They have nothing in common but the root.
    """
    paths = [os.path.abspath(file) for file in files] or [os.path.abspath("none")]
    folder = os.path.commonpath([os.path.dirname(path) for path in paths])
    if folder == os.sep and any(os.path.dirname(path) != os.sep for path in paths):
        raise InputError("--shard: the files have no folder in common; write them below one folder")
    below = os.path.relpath(folder)
    return Path(folder if below.startswith(os.pardir) else below)


def below(folder: Path, file: Path) -> str:
    """The path of a file relative to a folder."""
    return os.path.relpath(os.path.abspath(file), os.path.abspath(folder))


def record_path(folder: Path, shard: Shard) -> Path:
    """The path of a shard's record."""
    return folder / f"shard-{shard.number}-of-{shard.count}.json"


def write_record(folder: Path, record: ShardRecord, content: str) -> None:
    """Write the record of a shard."""
    data = {
        "content": content,
        "illum": record.version,
        "command": record.command,
        "shard": [record.shard.number, record.shard.count],
        "settings": record.settings,
        "units": [vars(unit) for unit in record.units],
        "results": {str(number): vars(result) for number, result in record.results.items()},
    }
    write_text(record_path(folder, record.shard), sealed_json([data], in_a_list=False))


def read_record(path: Path) -> ShardRecord:
    """The record of a shard.

    Raises
    ------
    InputError
        The file is none, or was changed or damaged since it was written.
    """
    try:
        if not is_sealed(path):
            raise InputError(f"{path}: was changed or damaged since it was written; run the shard again")
        data = json.loads(path.read_text(encoding="utf-8"))
        units = tuple(ShardUnit(**{**unit, "files": tuple(unit["files"])}) for unit in data["units"])
        results = {int(number): ShardResult(**result) for number, result in data["results"].items()}
        shard = Shard(*data["shard"])
        return ShardRecord(data["command"], shard, data["settings"], units, results, data["illum"])
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: is no record of a shard; take it out of the folder") from error


def difference(record: ShardRecord, other: ShardRecord) -> str:
    """In what the command of a record differs from that of another."""
    if record.version != other.version:
        return f"was written by illum {record.version}, another version"
    if record.command != other.command:
        return f"is of illum {record.command}, another command"
    if record.shard.count != other.shard.count:
        return f"is one of {record.shard.count} shards, another number"
    if len(record.units) != len(other.units):
        return f"is of {len(record.units)} units, another number"
    for mine, its in zip(record.units, other.units, strict=True):
        if vars(mine) != vars(its):
            return f"has another scene, other values or names of files ({mine.name})"
    return "names other tables, sheets or reports, or has other options,"
