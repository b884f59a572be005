"""MERL: a measured isotropic BRDF, looked up in the table of a `.binary` file.

response = n_l * f_r(theta_h, theta_d, phi_d)

The angles are Rusinkiewicz's: theta_h between normal and half vector; theta_d and phi_d of the light in the
half vector's frame. Exchanging light and eye rotates phi_d by pi, and the table covers only half a turn:
reciprocal. It has 90 x 90 x 180 cells, finer in theta_h near the highlight, in three planes R, G, B of 64-bit
numbers, to be scaled by 1, 1.15 and 1.66 over 1500. A negative number means no measurement and counts as 0.
The response is the measured BRDF times the cosine; whether it conserves energy depends on the measurement.

The file is memory-mapped at the first evaluation and shared by all threads.

References
----------
Matusik, W., Pfister, H., Brand, M., McMillan, L. (2003). A data-driven reflectance model. ACM ToG 22(3).
Rusinkiewicz, S. (1998). A new change of variables for efficient BRDF representation. EGWR '98.
"""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats, Vectors, dot
from illumcli.measured_files.merl import SCALE, cell_numbers, coordinates, mapped, values
from illumcli.models._base import IlluminationModel, Lobe


def rusinkiewicz(
    nxs: Vectors, n_s: Floats, n: Vectors, d: Vectors, s_s: Floats
) -> tuple[Floats, Floats, Floats]:
    """theta_h, theta_d and phi_d in radians, phi_d within -pi..pi and 0 where it is undefined.

    With d = l - v, and X and Y of the half vector's frame pointing away from the normal and across,
    l.Y = (n x s).d / (2 |n x s|) and l.X = -(n.d) |s| / (2 |n x s|): the azimuth of h is not needed.
    """
    size = np.sqrt(s_s)
    theta_h = np.arctan2(np.sqrt(dot(nxs, nxs)), n_s)
    theta_d = np.arctan2(np.sqrt(dot(d, d)), size)
    return theta_h, theta_d, np.arctan2(dot(nxs, d), -dot(n, d) * size)


class Merl(IlluminationModel):
    model: Literal["merl"] = "merl"
    file: str
    """Path of the measurement, from the scene's folder."""
    lookup: Literal["linear", "nearest"] = "linear"
    """`linear`: interpolate between the eight nearest cells, without those that have no measurement.
    `nearest`: take the nearest cell, with a step at every border between cells."""

    scales: ClassVar[dict[str, tuple[str, ...]]] = {}
    reciprocal: ClassVar[bool] = True
    physical: ClassVar[bool] = True

    def specular_lobe(
        self, n_l: Floats, n_s: Floats, s_s: Floats, nxs: Vectors, n: Vectors, d: Vectors
    ) -> Vectors:
        """(N, 3) n_l times the measurement."""
        angles = rusinkiewicz(nxs, n_s, n, d, s_s)
        table = mapped(self.file)
        look = _linear if self.lookup == "linear" else _nearest
        return (look(table, *angles) * n_l).T

    def lobes(self) -> dict[str, Lobe]:
        """The whole measurement is one lobe, `specular`."""
        return {"specular": self.specular_lobe}


def _nearest(table: NDArray[np.uint32], *angles: Floats) -> Floats:
    """(3, N) values of the cells that contain the angles; 0 without measurement."""
    flat = cell_numbers(*angles)[3]
    return _scaled(np.fmax(values(table, flat), 0), angles[0].dtype)


def _linear(table: NDArray[np.uint32], *angles: Floats) -> Floats:
    """(3, N) trilinear interpolation between cell centres, periodic in phi_d; 0 without any measurement."""
    # The lower of the two nearest cells along each axis, and the position between both.
    low, fractions = [], []
    for x in coordinates(*angles):
        below = np.floor(x - 0.5)
        low.append(below.astype(np.int64))
        fractions.append(x - 0.5 - below)

    # The weighted mean of those of the eight cells that have a measurement.
    total = np.zeros((3, len(low[0])))
    weights = np.zeros_like(total)
    for corner in np.ndindex(2, 2, 2):
        i, j, k = (each + step for each, step in zip(low, corner, strict=True))
        flat = (np.clip(i, 0, 89) * 90 + np.clip(j, 0, 89)) * 180 + k % 180
        weight = np.ones(len(flat))
        for fraction, step in zip(fractions, corner, strict=True):
            weight = weight * (fraction if step else 1 - fraction)
        found = values(table, flat)
        measured = weight * (found >= 0)
        total += measured * np.fmax(found, 0)
        weights += measured
    return _scaled(total / np.maximum(weights, np.finfo(np.float64).tiny), angles[0].dtype)


def _scaled(found: NDArray[np.float64], dtype: np.dtype[np.floating[Any]]) -> Floats:
    return (found * np.array(SCALE)[:, None]).astype(dtype)
