"""Texels whose centres several triangles cover."""

from __future__ import annotations

import numpy as np

from illumcli.atlas.centres import TexelsOnTriangles
from illumcli.atlas.triangles import AtlasTriangles
from illumcli.records import Value


class Overlaps(Value):
    """Numbers of texels."""

    read: int  # that lookups on the surface read
    several: int  # whose centres several triangles cover
    mirrored: int  # of these, with triangles of both orientations


def overlaps(triangles: AtlasTriangles, texels: TexelsOnTriangles) -> Overlaps:
    """How many texels have places on several triangles, from all places of `texels_of`."""
    count = np.bincount(texels.texel, minlength=triangles.size.texels)
    several = count > 1
    mirrored = np.bincount(texels.texel, triangles.is_mirrored[texels.number], triangles.size.texels)
    both = several & (mirrored > 0) & (mirrored < count)
    return Overlaps(*(int(np.count_nonzero(each)) for each in (count, several, both)))
