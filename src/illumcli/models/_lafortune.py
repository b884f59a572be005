"""A lobe of Lafortune's model: its shape, and its description in scenes."""

from __future__ import annotations

from typing import Annotated, TypeAlias

import numpy as np
from pydantic import Field

from illumcli.arrays import Floats, as_dtype_of
from illumcli.models._lobes import lobe
from illumcli.models._parameters import Varying
from illumcli.schema.description import Description
from illumcli.schema.fields import Color, NonNegative

Weight: TypeAlias = Varying[Annotated[float, Field(ge=-1, le=1)]]


class FurtherLobe(Description):
    """A lobe besides the first."""

    specular: Varying[Color] = (0.5, 0.5, 0.5)
    """rho_s, its height [1/sr]."""
    cx: Weight = -0.95
    """Cx, weight along the grain."""
    cy: Weight = -0.85
    """Cy, weight across the grain."""
    cz: Weight = 0.9
    """Cz, weight along the normal."""
    exponent: Varying[NonNegative] = 20.0
    """e, its exponent."""


def weighted_lobe(
    l: tuple[Floats, ...], v: tuple[Floats, ...], weights: tuple[object, ...], exponent: object
) -> Floats:
    """(N,) max(0, (C l).v)^e, with 1 - (C l).v = (|C l - v|^2 + |l|^2 - |C l|^2) / 2.

    Parameters
    ----------
    l, v : three (N,) arrays
        Components along the grain, across it and along the normal.
    weights : three numbers or (N,) arrays
    exponent : number or (N,) array
    """
    (e,) = as_dtype_of(l[0], exponent)
    gap = np.zeros_like(l[0])
    for c, to_light, to_eye in zip(as_dtype_of(l[0], *weights), l, v, strict=True):
        gap += np.square(c * to_light - to_eye) + (1 - c) * (1 + c) * np.square(to_light)
    return lobe(gap / 2, e)
