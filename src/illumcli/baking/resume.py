"""Finished units of a bake, in a journal beside its first output, with which a next run continues."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

from illumcli.arrays import F
from illumcli.baking.work import WorkUnit
from illumcli.cache.fingerprint import digest
from illumcli.errors import OutputError
from illumcli.files.atomic import is_full
from illumcli.files.journal import Journal, place
from illumcli.render_graph.keys import code
from illumcli.visibility.obscurance_error import Estimates

Result = TypeVar("Result")


def open_journal(output: Path, content: str) -> Journal:
    """The journal of one computation; processors with other instructions have another one."""
    return Journal(place(output, content), digest((content, code())))


def load_unit(journal: Journal, unit: WorkUnit, estimates: Estimates) -> int | None:
    """Copy the journal's values of a unit into `estimates`, which has a row for every point. Returns the rays
    that they took, or None if the journal has no values."""
    width = 2 if estimates.bent is None else 5
    record = journal.find(unit.key())
    if record is None or len(record) != 8 + 4 * width * len(unit.points):
        return None
    table = np.frombuffer(record, F, offset=8).reshape(-1, width)
    estimates.w[unit.points], estimates.neighbor_variation[unit.points] = table[:, 0], table[:, 1]
    if estimates.bent is not None:
        estimates.bent[unit.points] = table[:, 2:]
    return int.from_bytes(record[:8], "little")


def store_unit(journal: Journal, unit: WorkUnit, estimates: Estimates, rays: int) -> None:
    """Add a finished unit to the journal."""
    columns = [estimates.w[unit.points, None], estimates.neighbor_variation[unit.points, None]]
    if estimates.bent is not None:
        columns.append(estimates.bent[unit.points])
    table = np.concatenate(columns, axis=1)
    journal.append(unit.key(), rays.to_bytes(8, "little") + np.ascontiguousarray(table).tobytes())


def write_beside(journal: Journal, write: Callable[[], Result]) -> Result:
    """The result of `write`. If the disk is full, remove the journal, which is no longer needed, and call
    `write` again."""
    try:
        return write()
    except OutputError as error:
        if not is_full(error):
            raise
    journal.remove()
    return write()
