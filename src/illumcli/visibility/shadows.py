"""Is the way to a light free: delta(p, j), rays for lit lanes only."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Vectors, columns, rows
from illumcli.geometry.assemble import CornerVectors, World
from illumcli.rays.offsets import lifted, tangent_lift
from illumcli.rays.surface import Facets, Hits, corner_rows, facing
from illumcli.rays.tracer import Tracer
from illumcli.visibility.arriving import Lit


def shadow_origins(world: World, hits: Hits, facet: Facets, normals: CornerVectors | None = None) -> Vectors:
    """(M, 3) float32 where shadow rays start: off the facet, and off the curved surface that interpolated
    `normals` pretend, so that a coarse smooth mesh casts no shadow on its own lit side."""
    position = facet.position
    if normals is not None:
        at = corner_rows(world, hits.triangle, normals)
        corners = [rows(world.vertices, world.triangles[:, k].take(hits.triangle)) for k in range(3)]
        ends = [facing(rows(normals.values, index), facet.behind) for index in at]
        weights = (1 - hits.u - hits.v, hits.u, hits.v)
        position = position + tangent_lift(columns(position, F), corners, ends, weights)
    return lifted(position, facet.ng, facet.edge)


def shadow(tracer: Tracer, origins: Vectors, lit: Lit) -> NDArray[np.float32]:
    """(M,) delta: 1 where the light's way is free, 0 in shadow; 0 on lanes the light does not reach."""
    delta = np.zeros(lit.count, F)
    hidden = tracer.occluded(columns(rows(origins, lit.lane)), lit.l, lit.distance)
    delta[lit.lane] = ~hidden
    return delta
