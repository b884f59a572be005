"""Directions in the tangent spaces of a surface, in which normal maps are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import cross, dot, length, take_rows, unit
from illumcli.atlas.triangles import AtlasTriangles
from illumcli.baking.texel_points import TexelPoints, TexturePoints

Rows = NDArray[np.floating[Any]]


def to_tangent(direction: Rows, normal: Rows, tangent: Rows, sign: NDArray[Any]) -> Rows:
    """(N, 3) components of directions along tangent, bitangent and normal, as glTF and OpenGL have them: x
    towards +u, y up, towards the top of the picture, and z out of the surface.

    The frame is orthonormal: the tangent is made perpendicular to the normal, the bitangent is
    sign * normal x tangent (glTF 2.0, 3.7.2.1).

    Parameters
    ----------
    direction, normal : (N, 3)
        Unit vectors.
    tangent : (N, 3)
        The direction in which u grows.
    sign : (N,)
        1, or -1 where the uv are mirrored.
    """
    along = unit(tangent - dot(tangent, normal)[:, None] * normal)
    across = sign[:, None] * cross(normal, along)
    return np.stack([dot(direction, axis) for axis in (along, across, normal)], axis=1)


def texel_tangents(texture: TexturePoints, points: TexelPoints) -> tuple[Rows, NDArray[np.float64]]:
    """(K, 3) tangents at the points of a texture, not of unit length, and (K,) signs of their bitangents.

    They are interpolated from corners. There they are means, weighted by angle, over the triangles that share
    the vertex, the place in the texture and the handedness of uv, as in MikkTSpace.

    References
    ----------
    Mikkelsen, M. (2008). Simulation of wrinkled surfaces revisited. Master's thesis, Copenhagen.
    """
    # the tangent of each triangle, and its parts at the corners
    atlas, geometry = texture.triangles, points.geometry
    vertex = geometry.triangles[atlas.triangle].T
    corners = [take_rows(geometry.vertices, each).astype(np.float64) for each in vertex]
    hand = np.where(atlas.is_mirrored, -1.0, 1.0)
    along = _along_u(atlas, corners) * hand[:, None]
    parts = []
    for k in range(3):
        ahead, back = corners[k - 2] - corners[k], corners[k - 1] - corners[k]
        parts.append(along * np.arctan2(length(cross(ahead, back)), dot(ahead, back))[:, None])

    # their sums over the corners at one place
    x, y = atlas.x % atlas.size.width, atlas.y % atlas.size.height
    places = np.stack([vertex.ravel(), x.ravel(), y.ravel(), np.tile(hand, 3)], axis=1)
    _, index = np.unique(places, axis=0, return_inverse=True)
    weighted = np.concatenate(parts).T
    sums = np.stack([np.bincount(index.ravel(), part) for part in weighted], axis=1).astype(np.float64)
    at_corners = unit(sums[index.ravel()]).reshape(3, -1, 3)

    # at the points
    own = texture.points
    number = np.searchsorted(atlas.triangle, points.triangle[own])
    u, v = (each[own].astype(np.float64) for each in (points.u, points.v))
    weights = (1 - u - v, u, v)
    tangents = sum(w[:, None] * each[number] for w, each in zip(weights, at_corners, strict=True))
    return np.asarray(tangents), hand[number]


def _along_u(atlas: AtlasTriangles, corners: Sequence[Rows]) -> Rows:
    """(T, 3) directions of increasing u of triangles, unit; opposite to it where uv are mirrored."""
    v = -atlas.y / atlas.size.height
    towards_1, towards_2 = v[1] - v[0], v[2] - v[0]
    e1, e2 = corners[1] - corners[0], corners[2] - corners[0]
    return unit(towards_2[:, None] * e1 - towards_1[:, None] * e2)
