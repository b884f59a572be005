"""Tables of measured pairs: a CSV file with a line for each pair of directions.

| columns | what |
| --- | --- |
| `lx,ly,lz`, `vx,vy,vz` | directions to light and eye, of any length; z is the normal, x the grain |
| or `theta_l,phi_l`, `theta_v,phi_v` | their angles to the normal and azimuths from the grain [degrees] |
| `R,G,B` | the BRDF, radiance over irradiance [1/sr] |
| `error_R,error_G,error_B` | its standard errors [1/sr]; may be left out |
| `weight` | the share of the pair, such as its solid angle; by default equal for all; may be left out |

The first line names the columns, in any order; others are ignored.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Vectors, column_major, unit
from illumcli.errors import InputError
from illumcli.fitting.measurement import STEEPEST, Measurement, below_steepest

VALUES = ("R", "G", "B")
ERRORS = ("error_R", "error_G", "error_B")
LARGEST = 1e18
"""As large as a colour of a scene may be [1/sr]."""
Columns = dict[str, NDArray[np.float64]]


def read_table(path: Path) -> Measurement:
    """The pairs of a table below `STEEPEST`.

    Raises
    ------
    InputError
        The file cannot be read, a column is missing, a line is wrong, or no pair is left.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not text in UTF-8"
        raise InputError(f"{path}: cannot read the measurement: {reason}") from None
    columns = _columns(path, text)
    l, v = _directions(path, columns, "l"), _directions(path, columns, "v")
    values = _three(path, columns, VALUES)
    errors = _three(path, columns, ERRORS) if any(name in columns for name in ERRORS) else None
    weight = columns.get("weight", np.ones(len(values)))
    _refuse_lines(
        path, columns, np.any(np.abs(values) > LARGEST, axis=1), f"R, G, B must be at most {LARGEST:g}"
    )
    _refuse_lines(path, columns, weight < 0, "weight must be at least 0")
    if errors is not None:
        _refuse_lines(path, columns, np.any(errors <= 0, axis=1), "standard errors must be above 0")

    kept = np.flatnonzero(below_steepest(l, v) & (weight > 0))
    if not kept.size:
        raise InputError(f"{path}: has no pair with a weight and both angles up to {STEEPEST:g} degrees")
    return Measurement(
        l=column_major(l[kept]),
        v=column_major(v[kept]),
        values=values[kept],
        weight=weight[kept] / weight[kept].sum(),
        standard_error=None if errors is None else errors[kept],
        is_isotropic=False,
        about=f"{kept.size} of {len(values)} pairs, those up to {STEEPEST:g} degrees",
    )


def _columns(path: Path, text: str) -> Columns:
    """The numbers of the columns that are known, by name; `line` has the number of each line."""
    rows = list(csv.reader(io.StringIO(text)))
    if len(rows) < 2:
        raise InputError(f"{path}: must have a line of names and a line for each pair")
    names = [name.strip() for name in rows[0]]
    known = {*VALUES, *ERRORS, "weight"}
    known |= {f"{each}{axis}" for each in "lv" for axis in "xyz"}
    known |= {f"{angle}_{each}" for each in "lv" for angle in ("theta", "phi")}
    wanted = {name: place for place, name in enumerate(names) if name in known}
    numbers = []
    for line, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        try:
            numbers.append([line, *(float(row[place]) for place in wanted.values())])
        except (ValueError, IndexError):
            raise InputError(
                f"{path}:{line}: must have {len(names)} numbers, one for each name of the first line"
            ) from None
        if not np.all(np.isfinite(numbers[-1])):
            raise InputError(f"{path}:{line}: has a number that is not finite; leave such a line out")
    table = np.array(numbers).reshape(-1, 1 + len(wanted))
    return {name: table[:, column] for column, name in enumerate(["line", *wanted])}


def _directions(path: Path, columns: Columns, of: str) -> Vectors:
    """(N, 3) unit vectors `l` or `v`, from components or angles."""
    if f"theta_{of}" in columns:
        theta, phi = np.radians(_required(path, columns, [f"theta_{of}", f"phi_{of}"]))
        vectors = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1)
    else:
        vectors = np.stack(_required(path, columns, [f"{of}{axis}" for axis in "xyz"]), axis=1)
    _refuse_lines(path, columns, ~np.any(vectors, axis=1), f"{of} has no direction")
    return unit(column_major(vectors))


def _three(path: Path, columns: Columns, names: Sequence[str]) -> NDArray[np.float64]:
    return np.stack(_required(path, columns, names), axis=1)


def _required(path: Path, columns: Columns, names: Sequence[str]) -> list[NDArray[np.float64]]:
    missing = [name for name in names if name not in columns]
    if missing:
        raise InputError(
            f"{path}: has no column {', '.join(missing)}; name columns lx, ly, lz or theta_l, phi_l, the "
            "same for v, and R, G, B in the first line"
        )
    return [columns[name] for name in names]


def _refuse_lines(path: Path, columns: Columns, wrong: NDArray[np.bool_], fact: str) -> None:
    if wrong.any():
        raise InputError(f"{path}:{int(columns['line'][np.argmax(wrong)])}: {fact}")
