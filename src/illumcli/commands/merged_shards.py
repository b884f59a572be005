"""Shards of a command put together: its units, their files and results, and what is missing."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from illumcli.baking.files import SUFFIXES, baked_contents
from illumcli.commands.shard_files import PATTERN, ShardRecord, ShardUnit, difference, read_record
from illumcli.errors import InputError
from illumcli.files.atomic import AtomicFile
from illumcli.files.outputs import ContentReader, is_kept, refresh, stored_contents
from illumcli.images.contents import image_contents
from illumcli.records import Record

Records: TypeAlias = Mapping[Path, ShardRecord]
"""Path of a record -> what it says."""


class MergedShards(Record):
    """The whole command, with the results of all its shards that have a record."""

    command: str
    settings: Mapping[str, Any]
    outputs: Mapping[str, Path]
    """The files about all units."""
    units: tuple[ShardUnit, ...]
    folder: Path
    """Of the merged files."""
    reports: Mapping[int, Mapping[str, Any]]
    """By the index of a unit."""
    contents: Mapping[int, tuple[str, ...]]
    """Of the files of a unit."""
    missing: Mapping[int, str]
    """Index of a unit that has no report -> why."""

    def paths(self, number: int) -> list[Path]:
        """The merged files of a unit."""
        return [self.folder / name for name in self.units[number].files]


def merged_shards(folders: Sequence[Path], output: Path, force: bool) -> tuple[MergedShards, list[Path]]:
    """Read the records in some folders, and copy the files of their units below another. Returns the whole,
    and the files that were there already with the same content.

    Raises
    ------
    InputError
        A folder without a record; records that contradict each other.
    OutputError
        A different file is there, and `force` is not given.
    """
    records = _records(folders)
    whole = next(iter(records.values()))
    reports: dict[int, Mapping[str, Any]] = {}
    contents: dict[int, tuple[str, ...]] = {}
    missing: dict[int, str] = {}
    kept: list[Path] = []
    bands: dict[int, Path] = {}
    for number, unit in enumerate(whole.units):
        why = f"shard-{unit.shard}-of-{whole.shard.count}.json is missing"
        for path, record in records.items():
            result = record.results.get(number)
            if result is None or number in reports:
                continue
            why = result.error or _damage(path.parent, result.files)
            if why or result.report is None:
                continue
            if "picture" in unit.about:
                bands[number] = path.parent
            for name, content in () if number in bands else result.files.items():
                if _copy(path.parent / name, output / name, content, force):
                    kept.append(output / name)
            named = {key: [str(output / name) for name in result.report[key]] for key in ("written", "kept")}
            reports[number] = {**result.report, **named}
            contents[number] = tuple(result.files.values())
        if number not in reports:
            missing[number] = f"{unit.name}: {why}"
    outputs = {name: output / path for name, path in whole.settings["outputs"].items()}
    merged = MergedShards(
        whole.command, whole.settings, outputs, whole.units, output, reports, contents, missing
    )
    if not bands:
        return merged, kept
    from illumcli.commands.merged_bands import with_pictures

    merged, joined = with_pictures(merged, bands, force)
    return merged, [*kept, *joined]


def _records(folders: Sequence[Path]) -> dict[Path, ShardRecord]:
    """The records in some folders, which belong to one command."""
    records, problems = dict[Path, ShardRecord](), list[str]()
    for folder in folders:
        paths = sorted(folder.glob(PATTERN))
        records |= {path: read_record(path) for path in paths}
        if not paths:
            problems.append(f"{folder}: has no {PATTERN}; give the folders that runs with --shard wrote to")
    if problems:
        raise InputError(problems)
    first, whole = next(iter(records.items()))
    for path, record in records.items():
        if record.whole != whole.whole:
            way = "give folders of one command, and remove records of earlier ones"
            problems.append(f"{path}: {difference(record, whole)} than {first}; {way}")
        for number, result in record.results.items():
            for other, earlier in records.items():
                files = earlier.results[number].files if number in earlier.results else {}
                if other < path and files and result.files and files != result.files and not problems:
                    fact = f"{record.units[number].name}: has other contents than in {other}"
                    problems.append(f"{path}: {fact}; its inputs have changed: run one of the two again")
    if problems:
        raise InputError(problems)
    return records


def _reader(path: Path) -> ContentReader:
    return baked_contents if path.suffix.lower() in SUFFIXES else image_contents


def _damage(folder: Path, files: Mapping[str, str]) -> str:
    """What is wrong with the files of a unit; empty if they are there with their contents."""
    for name, content in files.items():
        path = folder / name
        try:
            if list(stored_contents(path, _reader(path))) != [content]:
                return f"{path} was changed or damaged since it was written; run its shard again"
        except OSError as error:
            return f"{path}: {(error.strerror or str(error)).lower()}"
    return ""


def _copy(source: Path, target: Path, content: str, force: bool) -> bool:
    """Copy a file. True if it is there already with the same content, and kept."""
    is_same = os.path.realpath(source) == os.path.realpath(target)
    if is_same or is_kept(target, [content], _reader(target), force):
        refresh(target)
        return True
    with AtomicFile(target) as part:
        shutil.copyfile(source, part.path)
    return False
