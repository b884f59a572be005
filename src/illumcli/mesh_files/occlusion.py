"""Occlusion textures as writers take them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from illumcli.records import Record


class OcclusionMap(Record):
    """The occlusion texture of the polygons of an object that have one material."""

    name: str
    png: bytes  # linear; readers take the red channel, 1 where open


class OcclusionMaps(Record):
    """The occlusion textures of all objects."""

    maps: Mapping[tuple[int, int], OcclusionMap] = field(default_factory=dict)
    """Object, and index in the material names of its mesh (-1 none) -> its texture."""
    uvs: Mapping[int, NDArray[np.float64]] = field(default_factory=dict)
    """Object -> (C, 2) uv of its corners, v upwards, if its textures do not use those of its file."""


NO_MAPS = OcclusionMaps()
