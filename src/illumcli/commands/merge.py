"""Merge the shards of a command: pictures, tables, sheets and reports of the whole."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from illumcli.commands.merged_shards import MergedShards, merged_shards
from illumcli.errors import IllumError
from illumcli.records import Value

SHOWN = 20
"""Missing units that are named."""


class Merge(Value):
    """The merged files: those of the units, then those about all of them."""

    paths: tuple[Path, ...]
    kept: tuple[Path, ...]
    """Those that were there already with the same content."""
    missing: tuple[str, ...]
    """A line for each unit that has no result."""

    def refuse_missing(self) -> None:
        """Raise IllumError if anything is missing: the units, and why."""
        if self.missing:
            more = len(self.missing) - SHOWN
            also = [f"and {more} more"] if more > 0 else []
            count = len(self.missing)
            total = "1 unit is missing" if count == 1 else f"{count} units are missing"
            raise IllumError("\n".join([*self.missing[:SHOWN], *also, total]))


def merge(folders: Sequence[Path], output: Path, force: bool = False) -> Merge:
    """Merge the shards whose records are in some folders. What is missing is left out.

    Raises
    ------
    InputError
        A folder has no record of a shard; records contradict each other.
    OutputError
        A different file is there, and `force` is not given; a file cannot be written.
    """
    whole, kept = merged_shards(folders, output, force)
    paths = [path for number in whole.reports for path in whole.paths(number)]
    written, unchanged = _write_about_all(whole, force)
    lines = tuple(whole.missing[number] for number in sorted(whole.missing))
    return Merge((*paths, *written, *unchanged), (*kept, *unchanged), lines)


def _write_about_all(whole: MergedShards, force: bool) -> tuple[list[Path], list[Path]]:
    """Write the files about all units. Returns those that were written, and those that are kept."""
    if whole.command == "sweep":
        from illumcli.commands.sweep_shard import merge_sweep

        return merge_sweep(whole, force)
    from illumcli.commands.batch_shard import merge_batch

    return merge_batch(whole, force)
