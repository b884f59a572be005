"""Lobe shapes and weights that several models share, in forms that keep their digits."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from illumcli.arrays import Floats, Vectors
from illumcli.schema.description import Description


def lobe(gap: Floats, exponent: Floats | float) -> Floats:
    """(N,) max(0, cos(angle))^exponent from gap = 1 - cos(angle); an exponent of 0 gives 1 at any angle.

    A power of a rounded cosine loses exponent * 2^-53 of its value; with the gap formed as half the squared
    distance of two unit vectors, exp(e log1p(-gap)) keeps its digits for exponents of 10^6 and more.
    """
    below_one = 1 - float(np.finfo(gap.dtype).epsneg)
    return np.exp(exponent * np.log1p(-np.minimum(gap, below_one))) * ((gap < 1) | (exponent == 0))


def log_cos(cosine: Floats, sin2: Floats) -> Floats:
    """(N,) logarithm of a cosine above 0: from sin^2 near 0 degrees, where the cosine has lost its digits."""
    near = sin2 < 0.5
    return np.log1p(-np.minimum(sin2, 0.5)) / 2 * near + np.log(cosine) * ~near


def channels(lanes: Floats, color: object) -> Floats:
    """A colour in the precision of `lanes`, channel by channel: (3, 1), or (3, N) where it varies.

    Its product with (N,) lanes is (3, N), whose transpose is (N, 3) column by column in memory.
    """
    values = np.asarray(color, lanes.dtype)
    return values[:, None] if values.ndim == 1 else values.T


def tint(color: object, lanes: Floats) -> Vectors:
    """(N, 3) the lanes weighted by a colour, or by one colour per lane."""
    return (channels(lanes, color) * lanes).T


def weighed(color: object, weight: object) -> Any:
    """A colour times a number, or (N, 3) where either varies; unchanged while either is still a texture."""
    if isinstance(color, Description) or isinstance(weight, Description):
        return color
    product = np.asarray(color) * np.asarray(weight)[..., None]
    return tuple(product.tolist()) if product.ndim == 1 else product


@cache
def gauss_legendre(order: int) -> tuple[tuple[float, float], ...]:
    """(node, weight) pairs on [-1, 1], exact for polynomials of degree 2 order - 1."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    return tuple(zip(nodes.tolist(), weights.tolist(), strict=True))
