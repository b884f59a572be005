"""MERL `.binary`: an isotropic, reciprocal BRDF in 90 x 90 x 180 cells by half and difference angles.

Three 32-bit numbers, the sizes, are followed by three planes R, G, B of 64-bit numbers, to be scaled by 1,
1.15 and 1.66 over 1500. A negative number means no measurement. theta_h and theta_d are polar angles of the
half vector about the normal and of the light about the half vector, phi_d is the azimuth of the light about
the half vector; phi_d + pi is the same pair with light and eye exchanged, and has no cells of its own.

References
----------
Matusik, W., Pfister, H., Brand, M., McMillan, L. (2003). A data-driven reflectance model. ACM ToG 22(3).
Rusinkiewicz, S. (1998). A new change of variables for efficient BRDF representation. EGWR '98.
"""

from __future__ import annotations

import os
from functools import lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats, Vectors, column_major
from illumcli.errors import InputError
from illumcli.measured_files._files import identity

Cells: TypeAlias = NDArray[np.int64]
Angles: TypeAlias = "Floats | float"

SHAPE = (90, 90, 180)  # theta_h, theta_d, phi_d
CELLS = 90 * 90 * 180
SCALE = (1 / 1500, 1.15 / 1500, 1.66 / 1500)
_NO_MEASUREMENT = -1.0


def coordinates(theta_h: Floats, theta_d: Floats, phi_d: Floats) -> tuple[Floats, Floats, Floats]:
    """Table coordinates in cells: 0..90 by the root of theta_h, 0..90 by theta_d, 0..180 by phi_d."""
    return (
        np.sqrt(theta_h * (2 / np.pi)) * 90,
        theta_d * (2 / np.pi) * 90,
        phi_d * (180 / np.pi) % 180,
    )


def cell_numbers(theta_h: Floats, theta_d: Floats, phi_d: Floats) -> tuple[Cells, Cells, Cells, Cells]:
    """Numbers of the cells that angles lie in: along theta_h, theta_d and phi_d, and in the flat table."""
    i, j, k = (
        np.clip(np.asarray(x, np.int64), 0, count - 1)
        for x, count in zip(coordinates(theta_h, theta_d, phi_d), SHAPE, strict=True)
    )
    return i, j, k, (i * SHAPE[1] + j) * SHAPE[2] + k


def directions(theta_h: Angles, theta_d: Floats, phi_d: Floats) -> tuple[Vectors, Vectors]:
    """(N, 3) unit vectors to light and eye about the normal z, the half vector in the plane of x and z.

    phi_d is counted from where theta_h grows; the eye is the light turned about the half vector by half a
    turn.
    """
    # In the half vector's frame the two are mirrored at its axis; turn that axis from z to h about y.
    x, y, z = np.sin(theta_d) * np.cos(phi_d), np.sin(theta_d) * np.sin(phi_d), np.cos(theta_d)
    cos, sin = np.cos(theta_h), np.sin(theta_h)
    l, v = (
        column_major(np.stack([cos * sign * x + sin * z, sign * y, cos * z - sin * sign * x], axis=1))
        for sign in (1, -1)
    )
    return l, v


def cell_directions(row: int) -> tuple[Vectors, Vectors]:
    """Unit vectors to light and eye at the centres of the cells of one theta_h, about the normal z.

    The half vector lies in the plane of x and z. Either direction may lie below the horizon.

    Parameters
    ----------
    row : int
        Number of theta_h, 0..89.

    Returns
    -------
    l, v : ndarray
        (16200, 3) float64, phi_d running fastest.
    """
    theta_h = ((row + 0.5) / 90) ** 2 * (np.pi / 2)
    theta_d = np.repeat((np.arange(90) + 0.5) / 90 * (np.pi / 2), 180)
    phi_d = np.tile(np.radians(np.arange(180) + 0.5), 90)
    return directions(theta_h, theta_d, phi_d)


def read(path: str | os.PathLike[str]) -> NDArray[np.float64]:
    """(3, 90, 90, 180) the BRDF in R, G, B [1/sr], NaN where there is no measurement.

    Raises
    ------
    InputError
        The file cannot be opened, or is not a MERL measurement.
    """
    planes = np.asarray(mapped(os.fspath(path))).view("<f8").reshape(3, *SHAPE)
    with np.errstate(invalid="ignore"):
        return np.where(planes >= 0, planes, np.nan) * np.array(SCALE)[:, None, None, None]


def encode(table: Floats) -> bytes:
    """The bytes of a file, 35 MB.

    Parameters
    ----------
    table : array_like
        (3, 90, 90, 180) the BRDF in R, G, B [1/sr], not negative; NaN where there is no measurement.
    """
    planes = np.asarray(table, np.float64).reshape(3, *SHAPE) / np.array(SCALE)[:, None, None, None]
    planes = np.where(np.isnan(planes), _NO_MEASUREMENT, planes)
    return np.array(SHAPE, "<i4").tobytes() + planes.astype("<f8").tobytes()


def mapped(path: str) -> NDArray[np.uint32]:
    """(3, 1458000, 2) the planes of a file, mapped read-only, each number as two 32-bit halves.

    The numbers begin 12 bytes into the file, where 64-bit numbers are not aligned: numpy would copy all of
    them at every look-up.

    Raises
    ------
    InputError
        The file cannot be opened, or is not a MERL measurement.
    """
    return _mapped(*identity(path))


@lru_cache(maxsize=64)
def _mapped(path: str, modified: int, size: int) -> NDArray[np.uint32]:
    expected = 12 + 3 * CELLS * 8
    with open(path, "rb") as file:
        shape = tuple(np.frombuffer(file.read(12).ljust(12, b"\0"), "<i4").tolist())
    if shape != SHAPE:
        raise InputError(
            f"{path}: must begin with the sizes 90, 90, 180, has {', '.join(map(str, shape))}; "
            "name a .binary file of the MERL database"
        )
    if size != expected:
        raise InputError(f"{path}: must have {expected} bytes, has {size}; fetch it again, it is not whole")
    return np.memmap(path, "<u4", "r", offset=12, shape=(3, CELLS, 2))


def values(planes: NDArray[np.uint32], cells: NDArray[np.int64]) -> NDArray[np.float64]:
    """(3, N) the numbers of cells of a mapped file, not scaled."""
    halves = np.asarray(planes).take(cells, axis=1)
    return halves.view("<f8")[..., 0].astype(np.float64, copy=False)
