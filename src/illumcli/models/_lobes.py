"""Lobe shapes and weights that several models share, in numerically stable forms."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from illumcli.arrays import Floats, Vectors
from illumcli.schema.description import Description


def lobe(gap: Floats, exponent: Floats | float) -> Floats:
    """(N,) max(0, cos(angle))^exponent from gap = 1 - cos(angle); an exponent of 0 gives 1 at any angle.

    A power of a rounded cosine has a relative error of exponent * 2^-53. With the gap computed as half the
    squared distance of two unit vectors, exp(e log1p(-gap)) is accurate for exponents of 10^6 and more.
    """
    below_one = 1 - float(np.finfo(gap.dtype).epsneg)
    power = np.negative(np.minimum(gap, below_one))
    np.log1p(power, out=power)
    power = np.multiply(exponent, power)
    np.exp(power, out=power)
    power *= (gap < 1) | (exponent == 0)
    return power


def log_cos(cosine: Floats, sin2: Floats) -> Floats:
    """(N,) logarithm of a cosine above 0; near 0 degrees from sin^2, where the cosine is inaccurate."""
    near = sin2 < 0.5
    return np.log1p(-np.minimum(sin2, 0.5)) / 2 * near + np.log(cosine) * ~near


def flattening(n_l: Floats, n_v: Floats, l_v: Floats) -> Floats:
    """(N,) s / t of Fujii (2013): -1 to 1, but large where light and eye meet at grazing.

    s = l.v - n_l n_v is the cosine of the azimuth times both sines; t = max(n_l, n_v) where s > 0, else 1.
    """
    s = np.maximum(l_v - n_l * n_v, -1)
    return np.where(s > 0, s / np.maximum(n_l, n_v), s)


def fifth(x: Floats) -> Floats:
    """(N,) x^5, as Schlick's curve has it."""
    square = x * x
    return square * square * x


def channels(like: Floats, color: object) -> Floats:
    """A colour in the precision of `like`, (N,), with the channels first: (3, 1), or (3, N) if it varies.

    Its product with (N,) values is (3, N), whose transpose is (N, 3) in column-major order.
    """
    values = np.asarray(color, like.dtype)
    return values[:, None] if values.ndim == 1 else values.T


def tint(color: object, values: Floats) -> Vectors:
    """(N, 3) product of values, (N,), and a colour, or one colour per value."""
    return (channels(values, color) * values).T


def weighted(color: object, weight: object) -> Any:
    """A colour times a number, (N, 3) if either varies; `color` itself if either is still a texture."""
    if isinstance(color, Description) or isinstance(weight, Description):
        return color
    product = np.asarray(color) * np.asarray(weight)[..., None]
    return tuple(product.tolist()) if product.ndim == 1 else product


def or_rest(share: Any, other: Any) -> Any:
    """A share; if it is None, what another leaves of 1, or the other itself if that is still a texture."""
    if share is not None:
        return share
    return other if isinstance(other, Description) else 1 - np.asarray(other)


@cache
def gauss_legendre(order: int) -> tuple[tuple[float, float], ...]:
    """(node, weight) pairs on [-1, 1], exact for polynomials of degree 2 order - 1."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    return tuple(zip(nodes.tolist(), weights.tolist(), strict=True))
