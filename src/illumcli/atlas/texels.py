"""The place on the surface of every texel that lookups read."""

from __future__ import annotations

import numpy as np

from illumcli.arrays import F
from illumcli.atlas.borders import BorderTexels, border_texels
from illumcli.atlas.centres import TexelsOnTriangles, covered_centres, joined
from illumcli.atlas.triangles import AtlasTriangles
from illumcli.records import Record

INSET = 1 / 16
"""How far inside its triangle the place of a border texel is [texels], and at most which share of the way to
the triangle's centroid: at a concave edge, a ray from the edge itself would pass through the other side."""


class Texels(Record):
    """The texels that lookups read: those whose centres triangles cover, then those along borders."""

    places: TexelsOnTriangles  # of a border texel the nearest place of a chart
    border: BorderTexels  # the last of the places


def texels_of(triangles: AtlasTriangles) -> Texels:
    """The texels of a texture; a centre that several triangles cover has a place on each."""
    centres = covered_centres(triangles)
    is_covered = np.zeros(triangles.size.texels, bool)
    is_covered[centres.texel] = True
    border = border_texels(triangles, is_covered)
    return Texels(joined([centres, _on_triangles(triangles, border)]), border)


def _on_triangles(triangles: AtlasTriangles, border: BorderTexels) -> TexelsOnTriangles:
    """The places of border texels, just inside their triangles."""
    # on the edge
    corner = border.edge.astype(np.int64)
    weights = np.zeros((3, len(corner)))
    every = np.arange(len(corner))
    weights[corner, every] = 1 - border.along
    weights[(corner + 1) % 3, every] = border.along

    # and from there towards the centroid
    x, y = triangles.x[:, border.number], triangles.y[:, border.number]
    steps = [(weights * axis).sum(axis=0) - axis.mean(axis=0) for axis in (x, y)]
    share = INSET / np.maximum(np.hypot(*steps), 1)
    weights += share * (1 / 3 - weights)
    return TexelsOnTriangles(border.texel, border.number, weights[1].astype(F), weights[2].astype(F))
