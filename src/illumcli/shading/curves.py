"""Curves over the surface at a moment: the value at each point from those of the maps there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.formula import parse
from illumcli.keyframes import interpolate
from illumcli.models._parameters import CurveOverSurface, Formulas, Keys

Doubles: TypeAlias = NDArray[np.float64]
WIDTHS = {"rate": 1, "delay": 1, "scale": 3, "offset": 3}
"""Numbers of each map of a curve of colours."""


def curve_at(curve: CurveOverSurface, maps: Mapping[str, NDArray[Any]], width: int) -> Doubles:
    """(N, C) scale * phi(rate * t - delay) + offset.

    Parameters
    ----------
    maps : mapping
        Name -> (N, 1) or (N, C) values of each map that varies over the surface; of one at least.
    width : int
        C, 3 for a colour and 1 for a number.
    """
    rate, delay, scale, offset = (_map(curve, maps, name, width) for name in WIDTHS)
    value = scale * phi(curve.phi, (rate * curve.moment - delay)[:, 0]) + offset
    return np.broadcast_to(value, (max(map(len, maps.values())), width))


def phi(curve: Keys | Formulas, at: Doubles) -> Doubles:
    """(N, C) the curve itself at moments, (N,); not finite where a formula is not."""
    if isinstance(curve, Keys):
        return interpolate(at, curve.positions, curve.values, curve.interpolation)
    frame, time = (at, at / curve.fps) if curve.over == "frame" else (at * curve.fps, at)
    return np.stack([parse(text, ("frame", "time")).value(frame, time) for text in curve.formulas], axis=1)


def _map(curve: CurveOverSurface, maps: Mapping[str, NDArray[Any]], name: str, width: int) -> Doubles:
    """(N, C) values of a map, or (1, C) its constant."""
    if name in maps:
        return maps[name].astype(np.float64)
    constant = np.asarray(getattr(curve, name), np.float64).reshape(1, -1)
    return constant[:, :width]
