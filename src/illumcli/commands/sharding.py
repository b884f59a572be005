"""What a shard does of a command, and the record that it leaves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from pathlib import Path
from typing import Any

from illumcli.cache.fingerprint import digest
from illumcli.commands.batch import Batch
from illumcli.commands.options import Shard
from illumcli.commands.shard_files import (
    ShardRecord,
    ShardResult,
    ShardUnit,
    below,
    folder_of,
    record_path,
    write_record,
)
from illumcli.commands.shards import shard_of_each
from illumcli.errors import OutputError
from illumcli.files.outputs import INCOMPLETE, is_kept, refresh
from illumcli.files.reports import report_contents
from illumcli.records import Value
from illumcli.render_graph.costs import Cost


class PlannedUnit(Value):
    """A unit of a command before it is done."""

    name: str
    files: tuple[Path, ...]
    cost: Cost = Cost(0, 0)
    about: Mapping[str, Any] = field(default_factory=dict)
    """What the files about all units say of it; paths are made relative."""


class Sharding:
    """A shard of a command: its units, and the record for `illum merge`.

    Parameters
    ----------
    command : str
        Name of the command.
    units : sequence of PlannedUnit
        All units of the command.
    outputs : mapping
        What is written about all units, name -> path; `illum merge` writes it.
    settings : mapping
        How these are written.
    """

    def __init__(
        self,
        command: str,
        shard: Shard,
        units: Sequence[PlannedUnit],
        outputs: Mapping[str, Path | None],
        settings: Mapping[str, Any],
    ) -> None:
        files = {name: path for name, path in outputs.items() if path is not None}
        self.folder = folder_of([*files.values(), *(path for unit in units for path in unit.files)])
        shards = shard_of_each([unit.cost for unit in units], shard.count)
        self.own = [number for number, each in enumerate(shards) if each == shard.number]
        """The indices of the units of this shard."""
        recorded = tuple(
            ShardUnit(unit.name, tuple(map(self._below, unit.files)), each, self._relative(unit.about))
            for unit, each in zip(units, shards, strict=True)
        )
        self._record = ShardRecord(command, shard, self._relative({**settings, "outputs": files}), recorded)
        self._contents: dict[int, dict[str, str]] = {}
        self._reports: dict[int, Mapping[str, Any]] = {}
        self._is_kept = False

    def look(self, contents: Mapping[int, Sequence[str]], force: bool) -> None:
        """Note the contents of the files of this shard's units, and look whether its record is there already.

        Raises
        ------
        OutputError
            The record of another command is there, and `force` is not given.
        """
        for number in self.own:
            if number in contents:
                names = self._record.units[number].files
                self._contents[number] = dict(zip(names, contents[number], strict=True))
        try:
            self._is_kept = is_kept(self._path, [self._content], report_contents, force)
        except OutputError as error:
            if error.__cause__ is not None or not self._path.is_file():
                raise
            fact = "is the record of another command"
            raise OutputError(f"{self._path}: {fact}; remove it, or write to another folder") from None

    def add(self, number: int, report: Mapping[str, Any]) -> None:
        """Note the report of a unit that was done."""
        paths = {key: [self._below(path) for path in report[key]] for key in ("written", "kept")}
        self._reports[number] = {**report, **paths}

    def finish(self, batch: Batch) -> str:
        """Write the record, unless the same is there. Returns a line about the shard."""
        failures = {number: str(error) for number, error in batch.failures.items() if number in self.own}
        is_complete = len(self._reports) == len(self.own)
        if self._is_kept and is_complete:
            refresh(self._path)
        else:
            results = {
                number: ShardResult(self._contents[number], self._reports[number])
                if number in self._reports
                else ShardResult(error=failures.get(number, "was not done"))
                for number in self.own
            }
            content = self._content if is_complete else INCOMPLETE
            write_record(self.folder, replace(self._record, results=results), content)
        shard, count = self._record.shard, len(self._record.units)
        done = f"{len(self.own)} of {count}" if self.own else f"none of {count}"
        return f"shard {shard}: {done}; illum merge joins it by {self._path}"

    @property
    def _path(self) -> Path:
        return record_path(self.folder, self._record.shard)

    @property
    def _content(self) -> str:
        return digest((self._record.whole, self._record.shard.number, sorted(self._contents.items())))

    def _below(self, path: Path | str) -> str:
        return below(self.folder, Path(path))

    def _relative(self, data: Any) -> Any:
        """Data for JSON, in which paths are relative to the folder."""
        if isinstance(data, Path):
            return self._below(data)
        if isinstance(data, Mapping):
            return {str(key): self._relative(value) for key, value in data.items()}
        if isinstance(data, list | tuple):
            return [self._relative(value) for value in data]
        return data
