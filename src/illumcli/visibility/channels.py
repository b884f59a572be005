"""Channels: what baked files hold of each vertex, corner or texel. `CHANNELS` has a row for each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.records import Value

Arrays: TypeAlias = Mapping[str, NDArray[np.float32]]
"""Channels by name: (N,) each, or (N, 3) those of directions."""


class Channel(Value):
    """A quantity of points."""

    what: str
    """Its name in `--what`."""
    kind: Literal["value", "error", "direction"]
    """How the points of a vertex are averaged: values by their mean, independent standard errors by its
    error, unit directions by the direction of their mean."""
    ply: tuple[str, ...]
    """Its properties in a PLY: each holds the values; of a direction, each a component."""
    otherwise: float = 0.0
    """At vertices without a polygon, in every component."""


CHANNELS: Mapping[str, Channel] = {
    "obscurance": Channel("ao", "value", ("obscurance", "quality"), 1.0),
    "standard_error": Channel("ao", "error", ("standard_error",)),
    "bent_normal": Channel("bent_normal", "direction", ("nx_bent", "ny_bent", "nz_bent")),
    "thickness": Channel("thickness", "value", ("thickness",)),
    "thickness_error": Channel("thickness", "error", ("thickness_error",)),
}
"""By name; glTF attributes are called `_OBSCURANCE` and so on. Directions are unit vectors in scene space.
Thickness and its standard error are in scene units."""


def whats() -> tuple[str, ...]:
    """The words of `--what`."""
    return tuple(dict.fromkeys(channel.what for channel in CHANNELS.values()))


def chosen(arrays: Arrays, what: Sequence[str]) -> dict[str, NDArray[np.float32]]:
    """Those of the arrays that are asked for, in the order of `CHANNELS`."""
    return {name: arrays[name] for name, each in CHANNELS.items() if each.what in what}


def ply_columns(arrays: Arrays) -> dict[str, NDArray[np.float32]]:
    """The properties of a PLY, (N,) each, by name."""
    columns: dict[str, NDArray[np.float32]] = {}
    for name, values in arrays.items():
        for k, column in enumerate(CHANNELS[name].ply):
            columns[column] = values[:, k] if values.ndim == 2 else values
    return columns
