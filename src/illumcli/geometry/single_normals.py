"""Normals of one polygon or vertex, by the functions for meshes, applied to a mesh of one polygon or ring."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from illumcli.geometry.corner_normals import Weights, corner_normals
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.polygon_normals import area_vectors, corner_crosses, polygon_normals


def cross_normal(vertices: ArrayLike, index: int) -> NDArray[np.float64]:
    """(3,) cross product at one vertex of a polygon, (v[i+1] - v[i]) x (v[i-1] - v[i]); not normalised."""
    return corner_crosses(_polygon(vertices))[index]


def edge_average_normal(vertices: ArrayLike) -> NDArray[np.float64]:
    """(3,) unit mean of the unit cross products at all vertices of a polygon."""
    return polygon_normals(_polygon(vertices), "edge_average")[0]


def newell_plane(vertices: ArrayLike) -> NDArray[np.float64]:
    """(4,) [a, b, c, d] of the plane a x + b y + c z + d = 0 by Martin-Newell, through the first vertex.

    (a, b, c) is twice the polygon's area vector.
    """
    normal = area_vectors(_polygon(vertices))[0]
    return np.append(normal, -normal @ np.asarray(vertices, np.float64)[0])


def plane_solve(p1: ArrayLike, p2: ArrayLike, p3: ArrayLike) -> NDArray[np.float64]:
    """(3,) the solution of p_i . (a, b, c) = -1 for three points, computed as -N / (N . p1).

    Its length is 1 / (distance of the plane from the origin); it points to the origin's side whatever the
    winding. Not finite where the plane contains the origin or the points are on a line.
    """
    normal = corner_crosses(_polygon(np.stack([p1, p2, p3])))[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return -normal / (normal @ np.asarray(p1, np.float64))


def vertex_normal(
    vertex: ArrayLike, ring: ArrayLike, closed: bool, weighting: Weights
) -> NDArray[np.float64]:
    """(3,) unit normal of a vertex in a ring of triangles (vertex, ring[i], ring[i + 1]).

    Parameters
    ----------
    ring : (k, 3) float
        Neighbours in counter-clockwise order.
    closed : bool
        True if a triangle joins the last neighbour to the first.
    """
    neighbors = np.asarray(ring, np.float64)
    first = np.arange(1, len(neighbors) + 1)
    second = np.roll(first, -1)
    triangles = np.stack([np.zeros_like(first), first, second], axis=1)
    mesh = Mesh.of_triangles(
        np.vstack([np.asarray(vertex, np.float64), neighbors]), triangles[: len(neighbors) if closed else -1]
    )
    computed = corner_normals(mesh, weighting, crease=180.0, use_file=False)
    return computed.normals[computed.index[0]]


def _polygon(vertices: ArrayLike) -> Mesh:
    points = np.array(vertices, np.float64)
    count = len(points)
    return Mesh(points, np.arange(count, dtype=np.int32), np.array([0, count], np.int32))
