"""Pictures of which shards rendered bands: joined, and one unit again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

from illumcli.cache.fingerprint import digest
from illumcli.commands.bands import report_of_pictures
from illumcli.commands.merged_shards import MergedShards
from illumcli.commands.report import Report
from illumcli.commands.shard_files import ShardUnit
from illumcli.files.outputs import is_kept, refresh
from illumcli.images.contents import image_contents
from illumcli.images.picture_bands import join_bands


def with_pictures(
    whole: MergedShards, folders: Mapping[int, Path], force: bool
) -> tuple[MergedShards, list[Path]]:
    """The shards of a render with pictures in place of their bands, and the pictures that exist already.

    Parameters
    ----------
    folders : mapping
        Index of a unit that is a band -> the folder that its files are below.

    Raises
    ------
    OutputError
        A different file exists, and `force` is not given.
    """
    units, kept = list[ShardUnit](), list[Path]()
    reports, contents = dict[int, Mapping[str, Any]](), dict[int, tuple[str, ...]]()
    missing = dict[int, str]()
    for picture, numbers in _units_by_picture(whole):
        new, unit = len(units), whole.units[numbers[0]]
        files = unit.files if picture is None else tuple(picture["files"])
        units.append(unit if picture is None else replace(unit, name=picture["name"], files=files))
        if lacking := [whole.missing[number] for number in numbers if number in whole.missing]:
            missing[new] = "; ".join(lacking)
        elif picture is None:
            reports[new], contents[new] = whole.reports[numbers[0]], whole.contents[numbers[0]]
        else:
            paths = [whole.folder / name for name in files]
            contents[new] = tuple(picture["contents"])
            for place, path in enumerate(paths):
                bands = [folders[number] / whole.units[number].files[place] for number in numbers]
                kept += _joined(bands, path, contents[new][place], force)
            of_bands = [Report.of_data(whole.reports[number]) for number in numbers]
            written = {*map(str, paths)}
            reports[new] = report_of_pictures(of_bands, digest(contents[new]), paths, written).as_data()
    return replace(whole, units=tuple(units), reports=reports, contents=contents, missing=missing), kept


def _joined(bands: Sequence[Path], path: Path, content: str, force: bool) -> list[Path]:
    """Write a picture of this content. Returns its path if it exists already."""
    if is_kept(path, [content], image_contents, force):
        refresh(path)
        return [path]
    join_bands(bands, path)
    return []


def _units_by_picture(whole: MergedShards) -> list[tuple[Mapping[str, Any] | None, Sequence[int]]]:
    """The picture of each run of bands with their indices; None with a unit that is no band."""

    def picture(number: int) -> tuple[int, Any]:
        of_unit = whole.units[number].about.get("picture")
        return (-1, of_unit) if of_unit else (number, None)

    return [(of[1], list(numbers)) for of, numbers in groupby(range(len(whole.units)), picture)]
