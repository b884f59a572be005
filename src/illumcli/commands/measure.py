"""Measure a surface: its rows are done here or on a cluster, and kept until the table can be written."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

from illumcli import __version__
from illumcli.commands.batch import Batch
from illumcli.commands.runner import Pieces, Runner
from illumcli.commands.unit import Worker
from illumcli.files.journal import Journal, tidy
from illumcli.files.outputs import refresh
from illumcli.gonioreflectometer.energy import albedos
from illumcli.gonioreflectometer.estimate import Estimate
from illumcli.gonioreflectometer.rows import row_count
from illumcli.gonioreflectometer.settings import MeasureSettings, SurfaceSource
from illumcli.gonioreflectometer.table import Table, files_of, is_done, table_of, write_table
from illumcli.gonioreflectometer.work import (
    MeasureOptions,
    MeasureRow,
    content_of,
    find_row,
    instrument_of,
    keep_row,
    open_rows,
)
from illumcli.progress import Progress
from illumcli.records import Value

Tell = Callable[[str], None]


class MeasureRequest(Value):
    """A surface, what is measured of it, and where the table goes."""

    source: SurfaceSource
    settings: MeasureSettings
    output: Path
    options: MeasureOptions = MeasureOptions()
    force: bool = False

    def row(self, number: int) -> MeasureRow:
        """A unit of work."""
        return MeasureRow(Path(self.source.text), self.source, self.settings, number, self.options)


def measure_surface(request: MeasureRequest, runner: Runner, tell: Tell) -> tuple[list[Path], bool]:
    """Measure a surface. Returns the files, and whether they existed already.

    `tell` is called with what is doubtful of the surface and of its table.

    Raises
    ------
    InputError, LimitError, OutputError
        Before anything is measured, if the fault can be found by then.
    """
    files = files_of(request.output, request.settings)
    content = content_of(request.source, request.settings)
    if is_done(files, content, request.force):
        for path in files:
            refresh(path)
        return list(files), True
    instrument, warnings = instrument_of(request.source, request.settings)
    for line in warnings:
        tell(line)
    with closing(open_rows(request.output, content)) as journal:
        rows = _rows(request, runner, tell, journal)
        surface = instrument.surface
        about = {
            "content": content,
            "version": __version__,
            "surface": request.source.text,
            "parameters": request.settings.as_data(),
            "triangles": len(surface.triangles),
            "footprint": [float(each) for each in surface.size],
            "rms_slope": surface.rms_slope(),
        }
        table = table_of(rows, request.settings, about)
        write_table(files, table)
        journal.remove()
    tidy(request.output)
    for line in remarks(request.output, table):
        tell(line)
    return list(files), False


def _rows(request: MeasureRequest, runner: Runner, tell: Tell, journal: Journal) -> list[Estimate]:
    """All rows; those of an interrupted run come from its journal."""
    count, worker = row_count(request.settings), Worker()
    rows = {number: row for number in range(count) if (row := find_row(journal, number)) is not None}
    if rows:
        tell(f"{request.output}: {len(rows)} of {count} rows were measured before")

    def run(number: int, progress: Progress) -> tuple[list[Path], Estimate]:
        if number in rows:
            return [], rows[number]
        return worker.run(worker.prepare(request.row(number)), progress)

    batch = Batch("rows", count, False, tell)
    pieces = Pieces(request.row, lambda _: None, run, frozenset(rows))
    for number, result in runner.results(batch, pieces):
        with batch.piece(number):
            _, row = result()
            if number not in rows:
                keep_row(journal, number, row)
            rows[number] = row
    batch.finish()
    return [rows[number] for number in range(count)]


def remarks(output: Path, table: Table) -> list[str]:
    """Lines about a table: its error, and what cannot be."""
    found = albedos(table)
    first = found.values[:, 0]
    shown = f"{first[0]:.3f}" if first.min() == first.max() else ", ".join(f"{each:.3f}" for each in first)
    lines = [
        f"{output}: standard error {100 * table.relative_error():.2g} % (root mean square over that of the "
        f"values), {table.about['rays']:,} rays; reflects {shown} of light from {found.theta[0]:.0f} degrees"
    ]
    if excess := found.excess():
        lines += [
            f"{output}: more light leaves than arrives in {len(excess)} of {len(found.theta)} directions, as "
            f"{excess[0]}; measure with more --samples or a finer --step"
        ]
    return lines
