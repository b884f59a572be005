"""RGL: a measured isotropic BRDF of the RGL material database, a `.bsdf` file in R, G, B.

response = rgb(x, theta_v) ndf(theta_h) / (4 sigma(theta_v))

rgb is what was measured, divided by what a surface of microfacets with the normals of `ndf` and the projected
area `sigma` would reflect. x lies on a grid that follows the highlight: the warp whose density is that of the
visible normals moves x to the half vector, given by its polar angle theta_h and its azimuth about the normal,
counted from the eye's. Values below 0, of colours outside of sRGB, count as 0.

The response is the measured BRDF times the cosine at the light. As in the authors' renderer, theta_i of the
file is the angle of the eye; a measurement is not exactly reciprocal. Whether it conserves energy depends on
it. The database has anisotropic and spectral measurements, too, which are not read.

The file is read at the first evaluation and shared by all threads.

References
----------
Dupuy, J., Jakob, W. (2018). An adaptive parameterization for efficient material acquisition and rendering.
ACM ToG 37(6), and their evaluation code, https://github.com/rgl-epfl/brdf-loader. Not followed: their single
precision, and its rounding.
"""

from __future__ import annotations

from functools import lru_cache
from typing import ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Floats, Vectors, dot, length
from illumcli.measured_files._files import identity
from illumcli.measured_files.rgl import read
from illumcli.models._base import IlluminationModel, Lobe
from illumcli.models._warp import Lookup, Warp, between, between_even


class Rgl(IlluminationModel):
    model: Literal["rgl"] = "rgl"
    file: str
    """Path of the measurement, a `_rgb.bsdf` file, from the scene's folder."""

    scales: ClassVar[dict[str, tuple[str, ...]]] = {}
    physical: ClassVar[bool] = True

    def specular_lobe(self, l: Vectors, n_v: Floats, n_s: Floats, nxv: Vectors, nxs: Vectors) -> Vectors:
        """(N, 3) the measurement, its cosine included."""
        theta_v = np.arctan2(length(nxv), n_v)
        theta_h = np.arctan2(length(nxs), n_s)
        azimuth = np.arctan2(dot(nxv, l), dot(nxv, nxs))
        angles = (each.astype(np.float64) for each in (theta_v, theta_h, azimuth))
        return _measured(_tables(*identity(self.file)), *angles).astype(l.dtype, order="F")

    def lobes(self) -> dict[str, Lobe]:
        """The whole measurement is one lobe, `specular`."""
        return {"specular": self.specular_lobe}


class Tables(NamedTuple):
    """What is looked up in a measurement."""

    theta: NDArray[np.float64]
    """Angles of the eye [rad]."""
    warp: Warp
    """Of the grid of `rgb` onto half vectors."""
    rgb: Lookup
    """What was measured, on its grid."""
    ndf: NDArray[np.float64]
    """The density of normals, by the root of their angle."""
    sigma: NDArray[np.float64]
    """The projected area, by the root of the eye's angle."""
    is_divided: bool
    """True if `rgb` is to be multiplied by ndf / (4 sigma)."""


@lru_cache(maxsize=16)
def _tables(path: str, modified: int, size: int) -> Tables:
    """The tables of a file, kept until it changes."""
    theta, ndf, sigma, vndf, rgb, is_divided = read(path)
    return Tables(theta, Warp.of(vndf), Lookup.of(rgb), ndf, sigma, is_divided)


def _measured(
    tables: Tables, theta_v: NDArray[np.float64], theta_h: NDArray[np.float64], azimuth: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(N, 3) the BRDF times the cosine, from angles [rad]."""
    angle = between(tables.theta, theta_v)
    u_v, u_h = (np.sqrt(theta * (2 / np.pi)) for theta in (theta_v, theta_h))
    turn = azimuth / (2 * np.pi) + 0.5
    values = tables.rgb.at(angle, *tables.warp.invert(angle, u_h, turn - np.floor(turn)))
    if tables.is_divided:
        values *= (_even(tables.ndf, u_h) / (4 * _even(tables.sigma, u_v)))[:, None]
    return np.maximum(values, 0, out=values)


def _even(table: NDArray[np.float64], u: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N,) a table over 0 to 1, interpolated."""
    place = between_even(u, len(table))
    return place.blend(table[place.low], table[place.high])
