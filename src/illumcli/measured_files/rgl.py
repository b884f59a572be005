"""RGL `.bsdf`: an isotropic BRDF in R, G, B, measured on a grid that follows its highlight.

    theta_i (S,)             angles of incidence [rad], ascending
    phi_i (1,)               one azimuth: isotropic
    ndf, sigma (A, U)        density of microfacet normals by their angle; projected area by the eye's
    vndf (1, S, A, U)        density of visible normals: warps the grid of `rgb` onto normals
    rgb (1, S, 3, Y, X)      the measurement, divided by the distribution of normals
    jacobian (1,)            1 if it is so divided

All are 32-bit floats but `jacobian`, which is a byte. Along U the root of the polar angle grows evenly, along
A the azimuth. Other fields (`luminance` for importance sampling, `description`, `valid`) are not read.

References
----------
Dupuy, J., Jakob, W. (2018). An adaptive parameterization for efficient material acquisition and rendering.
ACM ToG 37(6). https://rgl.epfl.ch/materials
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.measured_files import tensor_file
from illumcli.measured_files.tensor_file import Field

Array = NDArray[np.float64]

MOST_VALUES = 1 << 24
"""In one field; those of the database have up to 131,072."""
BRIGHTEST = 1e30
"""Larger values of a BRDF are no measurement, and overflow in single precision."""
_AGAIN = "fetch it from the RGL database again"
_FLOATS = ("theta_i", "phi_i", "ndf", "sigma", "vndf", "rgb")


class Measurement(NamedTuple):
    """The fields of an isotropic measurement in R, G, B."""

    theta: Array
    """(S,) angles of incidence [rad], ascending."""
    ndf: Array
    """(U,) not negative."""
    sigma: Array
    """(U,) positive."""
    vndf: Array
    """(S, A, U) not negative, each slice with a positive sum."""
    rgb: Array
    """(S, 3, Y, X); a few values are negative, colours outside of sRGB."""
    is_divided: bool
    """True if `rgb` is to be multiplied by ndf / (4 sigma)."""


def read(path: str) -> Measurement:
    """The measurement in a file.

    Raises
    ------
    InputError
        The file cannot be read, is not whole, or is a measurement of another kind.
    """
    fields = tensor_file.fields(path)
    _refuse_other_kinds(path, fields)
    shapes = _checked_shapes(path, fields)
    arrays = {}
    for name in shapes:
        stored = tensor_file.load(path, fields[name])
        if not np.isfinite(stored).all():
            raise InputError(f"{path}: field '{name}' has values that are not finite; {_AGAIN}")
        arrays[name] = stored.astype(np.float64)
    measurement = Measurement(
        arrays["theta_i"],
        _without_azimuth(path, "ndf", arrays["ndf"]),
        _without_azimuth(path, "sigma", arrays["sigma"]),
        arrays["vndf"][0],
        arrays["rgb"][0],
        bool(arrays["jacobian"][0]),
    )
    _check_values(path, measurement)
    return measurement


def _refuse_other_kinds(path: str, fields: dict[str, Field]) -> None:
    """Raise InputError for measurements that are whole, but spectral or anisotropic."""
    if "rgb" not in fields and "spectra" in fields:
        raise InputError(
            f"{path}: is a spectral measurement, and those in R, G, B are read; "
            "fetch the file of the same material that ends in _rgb.bsdf"
        )
    phi = fields.get("phi_i")
    if phi is not None and len(phi.shape) == 1 and phi.shape[0] > 1:
        raise InputError(
            f"{path}: is an anisotropic measurement ({phi.shape[0]} azimuths of incidence), and isotropic "
            "ones are read; choose an isotropic material, or fit an anisotropic model such as ward"
        )


def _checked_shapes(path: str, fields: dict[str, Field]) -> dict[str, tuple[int | None, ...]]:
    """The fields that are read, with what their shapes must be; None for sizes that may vary.

    Raises
    ------
    InputError
        A field is missing, or its type or shape is another.
    """
    count = fields["theta_i"].shape[0] if "theta_i" in fields and fields["theta_i"].shape else None
    shapes: dict[str, tuple[int | None, ...]] = {
        "theta_i": (count,),
        "phi_i": (1,),
        "ndf": (None, None),
        "sigma": (None, None),
        "vndf": (1, count, None, None),
        "rgb": (1, count, 3, None, None),
        "jacobian": (1,),
    }
    for name, expected in shapes.items():
        if name not in fields:
            raise InputError(f"{path}: has no field '{name}'; name an _rgb.bsdf file of the RGL database")
        dtype, shape, _ = fields[name]
        kind = "f4" if name in _FLOATS else "u1"
        if dtype != kind:
            raise InputError(f"{path}: field '{name}' must be of type {kind}, is of {dtype}; {_AGAIN}")
        is_likely = len(shape) == len(expected) and all(
            size == want if want is not None else size >= 2
            for size, want in zip(shape, expected, strict=True)
        )
        if not is_likely or 0 in shape:
            want = ", ".join("any" if each is None else str(each) for each in expected)
            raise InputError(f"{path}: field '{name}' must have the shape ({want}), has {shape}; {_AGAIN}")
        if np.prod(shape, dtype=object) > MOST_VALUES:
            raise InputError(
                f"{path}: field '{name}' has the shape {shape}, more than {MOST_VALUES:,} values; {_AGAIN}"
            )
    return shapes


def _without_azimuth(path: str, name: str, rows: Array) -> Array:
    """(U,) a function that is the same at all azimuths, as isotropic ones are."""
    if (rows != rows[0]).any():
        fact = "varies with the azimuth, and the eye's azimuth does not"
        raise InputError(f"{path}: field '{name}' {fact}; {_AGAIN}")
    return rows[0]


def _check_values(path: str, measurement: Measurement) -> None:
    """Raise InputError for values that no measurement has."""
    theta, ndf, sigma, vndf, rgb, is_divided = measurement
    ascends = (np.diff(theta) > 0).all() and theta[0] >= 0 and theta[-1] < 1.6
    is_density = (vndf >= 0).all() and (vndf.sum(axis=(1, 2)) > 0).all()
    brightest = np.abs(rgb).max() * (ndf.max() / (4 * max(sigma.min(), 1e-300)) if is_divided else 1)
    rules = (
        (ascends, "'theta_i' must ascend from 0 to pi/2"),
        ((ndf >= 0).all(), "'ndf' must not be negative"),
        ((sigma > 0).all(), "'sigma' must be above 0"),
        (is_density, "'vndf' must be a density at each angle"),
        (brightest <= BRIGHTEST, f"'rgb' gives up to {brightest:.3g}/sr, which no surface reflects"),
    )
    for is_kept, rule in rules:
        if not is_kept:
            raise InputError(f"{path}: field {rule}; {_AGAIN}")
