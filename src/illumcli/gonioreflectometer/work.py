"""A measurement as units of work: its rows, each by itself, kept in a journal until all are there."""

from __future__ import annotations

import os
import struct
from pathlib import Path

import numpy as np

from illumcli import __version__
from illumcli.cache.fingerprint import FileFingerprint, digest
from illumcli.files.journal import Journal, place
from illumcli.gonioreflectometer.estimate import Estimate
from illumcli.gonioreflectometer.rows import Instrument
from illumcli.gonioreflectometer.settings import MeasureSettings, SurfaceSource
from illumcli.gonioreflectometer.sources import is_file, read_surface
from illumcli.memory import refuse_beyond
from illumcli.mesh_files import companions
from illumcli.progress import Progress, no_progress
from illumcli.records import Record, Value
from illumcli.render_graph.keys import code

TRIANGLE_BYTES = 500
"""Of a triangle with its normal, its place in Embree's tree, and its share of copies around a tile."""
_HEAD = struct.Struct("<qq")  # samples, rays


class MeasureOptions(Value):
    """How a measurement is computed."""

    threads: int | None = None
    """Number of threads; by default one per core."""
    overrides: tuple[str, ...] = ()
    """None: surfaces are no scenes."""


class MeasureRow(Value):
    """A row of a table, a unit of work: see `commands/unit.py`."""

    path: Path
    """The file of the surface; a formula as it is."""
    source: SurfaceSource
    settings: MeasureSettings
    number: int
    options: MeasureOptions = MeasureOptions()

    @property
    def threads(self) -> int:
        """Number of threads."""
        return self.options.threads or len(os.sched_getaffinity(0))

    def prepared(self, instruments: dict[object, Instrument]) -> MeasureWork:
        """The row with its instrument: one of those at hand, or a new one that is added to them.

        Raises
        ------
        InputError, LimitError
            The surface cannot be read or understood.
        """
        key = (self.source, self.settings)
        if key not in instruments:
            instruments[key] = instrument_of(*key)[0]
        return MeasureWork(self, instruments[key])

    def files(self) -> list[Path]:
        """The files that the surface is read from."""
        return [self.path, *companions(self.path)] if is_file(str(self.path)) else []


class MeasureWork(Record):
    """A row, and the instrument that measures it."""

    row: MeasureRow
    instrument: Instrument

    def run(self, progress: Progress = no_progress) -> Estimate:
        """The cells of the row."""
        return self.instrument.row(self.row.number, self.row.threads, progress)


def instrument_of(source: SurfaceSource, settings: MeasureSettings) -> tuple[Instrument, list[str]]:
    """The surface on its bench, and what is doubtful of it.

    Raises
    ------
    InputError, LimitError
        It cannot be read or understood.
    """
    surface, warnings = read_surface(source)
    what = f"{source.text}: {len(surface.triangles):,} triangles"
    refuse_beyond(TRIANGLE_BYTES * len(surface.triangles), what, "take a coarser --grid, or a smaller mesh")
    return Instrument(surface, settings), warnings


def content_of(source: SurfaceSource, settings: MeasureSettings) -> str:
    """Hash of everything that the values depend on."""
    path = Path(source.text)
    read = FileFingerprint(lambda: path, companions) if is_file(source.text) else source.text
    return digest((__version__, read, {**vars(source), "text": ""}, settings.as_data()))


def open_rows(output: Path, content: str) -> Journal:
    """The journal of the rows of a table; processors with other instructions have another one."""
    return Journal(place(output, content), digest((content, code())))


def find_row(journal: Journal, number: int) -> Estimate | None:
    """A row of the journal; None if it is not there."""
    record = journal.find(_key(number))
    if record is None:
        return None
    samples, rays = _HEAD.unpack_from(record)
    table = np.frombuffer(record, np.float64, offset=_HEAD.size).reshape(2, 3, -1)
    return Estimate(table[0], table[1], samples, rays)


def keep_row(journal: Journal, number: int, row: Estimate) -> None:
    """Add a row to the journal."""
    table = np.stack([row.values, row.errors])
    journal.append(_key(number), _HEAD.pack(row.samples, row.rays) + np.ascontiguousarray(table).tobytes())


def _key(number: int) -> bytes:
    return number.to_bytes(16, "little")
