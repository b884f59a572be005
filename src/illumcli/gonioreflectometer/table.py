"""The table of a measurement: put together from its rows, written and read."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.cache.fingerprint import file_digest
from illumcli.errors import InputError
from illumcli.files.atomic import AtomicFile, write_bytes
from illumcli.files.outputs import is_kept, refuse_suffix
from illumcli.files.seal import seal_archive
from illumcli.gonioreflectometer.directions import AngleGrid
from illumcli.gonioreflectometer.estimate import Estimate, of_replicates, relative_error
from illumcli.gonioreflectometer.mirrors_again import BLOCK_COUNT, of_cells
from illumcli.gonioreflectometer.settings import MeasureSettings
from illumcli.measured_files import merl
from illumcli.records import Record


class Table(Record):
    """A measured BRDF with its standard errors [1/sr], NaN without measurement.

    Isotropic: axes channel, theta_h, theta_d, phi_d, the cells of MERL. Otherwise: channel, theta and phi of
    the light, theta and phi of the eye, all at the centres of equal steps.
    """

    brdf: NDArray[np.float32]
    standard_error: NDArray[np.float32]
    samples: NDArray[np.int32]  # of a cell, per row
    about: Mapping[str, Any]

    @property
    def is_isotropic(self) -> bool:
        """True if the table has the cells of MERL."""
        return self.brdf.ndim == 4

    def grid(self) -> AngleGrid:
        """The directions of a table that is not isotropic."""
        return AngleGrid(90 / self.brdf.shape[1])

    def relative_error(self) -> float:
        """Root mean square of the standard errors over that of the values, both times n.l n.v."""
        if self.is_isotropic:
            pairs = [merl.cell_directions(row) for row in range(merl.SHAPE[0])]
            weights = np.concatenate([l[:, 2] * v[:, 2] for l, v in pairs])
        else:
            cosine = self.grid().directions[:, 2]
            weights = np.outer(cosine, cosine).ravel()
        brdf, error = (each.reshape(3, -1) for each in (self.brdf, self.standard_error))
        return relative_error(brdf, error, weights)


def table_of(rows: Sequence[Estimate], settings: MeasureSettings, about: Mapping[str, Any]) -> Table:
    """The table of all rows."""
    if not settings.isotropic:
        grid = AngleGrid(settings.step)
        shape: tuple[int, ...] = (3, grid.polar, grid.around, grid.polar, grid.around)
        own = rows
    else:
        shape, own = (3, *merl.SHAPE), rows[: merl.SHAPE[0]]
    values, errors = (
        np.stack([getattr(row, name) for row in own], axis=1).reshape(shape) for name in ("values", "errors")
    )

    # What mirrors reflect several times comes in replicates of all cells.
    if again := rows[len(own) :]:
        replicates = np.stack([row.values for row in again], axis=-1)
        more, spread = of_replicates(replicates, np.zeros((3, BLOCK_COUNT)), 1)
        values = values + of_cells(more)
        errors = np.hypot(errors, of_cells(spread))
    samples = np.array([row.samples for row in own], np.int32)
    rays = sum(row.rays for row in rows)
    return Table(values.astype(np.float32), errors.astype(np.float32), samples, {**about, "rays": rays})


def files_of(output: Path, settings: MeasureSettings) -> tuple[Path, ...]:
    """The files of a measurement: a MERL table has its errors in a table of the same name beside it.

    Raises
    ------
    InputError
        The name has another suffix.
    """
    suffixes = (".binary", ".npz") if settings.isotropic else (".npz",)
    refuse_suffix(output, "a measurement" if settings.isotropic else "an anisotropic measurement", *suffixes)
    return tuple(dict.fromkeys((output, output.with_suffix(".npz"))))


def is_done(files: Sequence[Path], content: str, force: bool) -> bool:
    """True if the files of a measurement exist with this content.

    Raises
    ------
    OutputError
        A different file is there; a file cannot be written.
    """
    *others, table = files
    is_there = is_kept(table, [content], table_contents, force)
    for other in others:
        if is_there and other.is_file() and read_about(table).get("binary") == file_digest(other):
            continue
        is_kept(other, [content], _no_contents, force or is_there)
        is_there = False
    return is_there


def write_table(files: Sequence[Path], table: Table) -> None:
    """Write a measurement."""
    *others, last = files
    about = dict(table.about)
    for other in others:
        write_bytes(other, merl.encode(np.maximum(table.brdf, 0)))
        about["binary"] = file_digest(other)
    arrays = {name: getattr(table, name) for name in ("brdf", "standard_error", "samples")}
    with AtomicFile(last) as part:
        with part.path.open("wb") as file:
            np.savez_compressed(file, **arrays, about=np.array(json.dumps(about)))
        seal_archive(part.path)


def read_table(path: Path) -> Table:
    """What `write_table` wrote beside or without a MERL table.

    Raises
    ------
    InputError
        Another kind of file, or a damaged one.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            return Table(
                data["brdf"], data["standard_error"], data["samples"], json.loads(str(data["about"]))
            )
    except Exception as why:  # zipfile, numpy and json each have their own exceptions
        raise InputError(f"{path}: is no measurement ({why}); make it with illum measure") from why


def read_about(path: Path) -> dict[str, Any]:
    """`Table.about` of a file."""
    with np.load(path, allow_pickle=False) as data:
        return dict(json.loads(str(data["about"])))


def table_contents(path: Path) -> list[str]:
    """The content hash of a file.

    Raises
    ------
    InputError
        A file that illum did not write.
    """
    try:
        return [str(read_about(path)["content"])]
    except Exception as why:  # zipfile, numpy and json each have their own exceptions
        raise InputError(f"{path}: is no measurement ({why}); make it with illum measure") from why


def _no_contents(path: Path) -> list[str]:
    return []
