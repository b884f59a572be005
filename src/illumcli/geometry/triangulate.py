"""Triangles of a mesh's polygons."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import Vectors, cross, dot, take_rows
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.polygon_normals import area_vectors, corner_crosses
from illumcli.records import Record

SHORTER = 1 - 1e-9
"""Ratio of squared lengths below which one diagonal is shorter than the other by more than rounding: the
quads of a regular grid are all split the same way."""
STRAIGHT = 1e-9
"""Share of the polygon's area: a corner that turns by less counts as straight."""


class Triangulation(Record):
    """Triangles over the corners of a mesh, in the order and orientation of their polygons.

    Arrays are read-only.
    """

    corners: NDArray[np.int32]  # (T, 3) corner numbers
    polygon: NDArray[np.int32]  # (T,) the polygon each was cut from

    def __post_init__(self) -> None:
        self.corners.setflags(write=False)
        self.polygon.setflags(write=False)


def triangulate(mesh: Mesh) -> Triangulation:
    """The polygons as triangles that cover the same area; no vertex is added.

    Triangles are kept. A quad is cut along its shorter diagonal, a concave one along the inner one.
    Larger convex polygons become fans around their first corner, concave ones are cut by ear clipping on
    their Newell plane. A polygon without area still gives triangles, so nothing is dropped silently.
    """
    size = np.diff(mesh.starts)
    if (size == 3).all():
        count = mesh.polygon_count
        return Triangulation(
            np.arange(3 * count, dtype=np.int32).reshape(-1, 3), np.arange(count, dtype=np.int32)
        )

    # Cut the polygons by their kind.
    triangles, quads, larger = (np.flatnonzero(which) for which in (size == 3, size == 4, size > 4))
    parts = [(mesh.starts[triangles][:, None] + np.arange(3), triangles)]
    if len(quads):
        parts.append(_quads(mesh, quads))
    if len(larger):
        concave = _concave(mesh, larger)
        parts.append(_fans(mesh, larger[~concave]))
        parts += [_ears(mesh, polygon) for polygon in larger[concave]]

    # Sort into the order of the polygons.
    corners = np.concatenate([part for part, _ in parts]).astype(np.int32)
    polygon = np.concatenate([of for _, of in parts]).astype(np.int32)
    order = np.argsort(polygon, kind="stable")
    return Triangulation(corners[order], polygon[order])


def _quads(mesh: Mesh, quads: NDArray[np.intp]) -> tuple[NDArray[Any], NDArray[Any]]:
    """(2 Q, 3) corners of both halves of each quad, and (2 Q,) their polygons."""
    corners = mesh.starts[quads][:, None] + np.arange(4, dtype=np.int32)
    p = [take_rows(mesh.vertices, mesh.corners[corner]) for corner in corners.T]
    even, odd = p[2] - p[0], p[3] - p[1]
    normal = cross(even, odd)
    is_reflex = [dot(cross(p[i - 3] - p[i], p[i - 1] - p[i]), normal) < 0 for i in range(4)]
    shorter = dot(odd, odd) < SHORTER * dot(even, even)
    from_odd = np.where(is_reflex[0] | is_reflex[2], False, is_reflex[1] | is_reflex[3] | shorter)
    halves = np.where(from_odd[:, None], [0, 1, 3, 1, 2, 3], [0, 1, 2, 0, 2, 3])
    return np.take_along_axis(corners, halves, axis=1).reshape(-1, 3), np.repeat(quads, 2)


def _concave(mesh: Mesh, polygons: NDArray[np.intp]) -> NDArray[np.bool_]:
    """(K,) True for polygons that have a reflex corner, by more than rounding."""
    part, _ = _submesh(mesh, polygons)
    normals = area_vectors(part)
    turn = dot(
        corner_crosses(part), take_rows(normals, np.repeat(np.arange(len(polygons)), np.diff(part.starts)))
    )
    return np.minimum.reduceat(turn, part.starts[:-1]) < -STRAIGHT * dot(normals, normals)


def _submesh(mesh: Mesh, polygons: NDArray[np.intp]) -> tuple[Mesh, NDArray[np.int32]]:
    """These polygons as a mesh of their own with a vertex per corner, and (C,) their corners in `mesh`."""
    size = np.diff(mesh.starts)[polygons]
    starts = np.concatenate([[0], np.cumsum(size)]).astype(np.int32)
    corners = np.arange(starts[-1], dtype=np.int32) + np.repeat(mesh.starts[polygons] - starts[:-1], size)
    points = take_rows(mesh.vertices, mesh.corners[corners])
    return Mesh(points, np.arange(starts[-1], dtype=np.int32), starts), corners


def _fans(mesh: Mesh, polygons: NDArray[np.intp]) -> tuple[NDArray[Any], NDArray[Any]]:
    """(F, 3) corners of the triangles around each polygon's first corner, and (F,) their polygons."""
    count = np.diff(mesh.starts)[polygons] - 2
    first = np.repeat(mesh.starts[polygons], count)
    step = np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)
    return np.stack([first, first + step + 1, first + step + 2], axis=1), np.repeat(polygons, count)


def _ears(mesh: Mesh, polygon: np.intp) -> tuple[NDArray[Any], NDArray[Any]]:
    """(F, 3) corners of the triangles of one concave polygon, by ear clipping, and (F,) the polygon.

    A fan if the polygon crosses itself so that ear clipping yields no triangle.
    """
    from mapbox_earcut import triangulate_float64

    part, corners = _submesh(mesh, np.array([polygon]))
    flat = _on_plane(part.vertices, area_vectors(part)[0])
    cut = triangulate_float64(flat, np.array([len(flat)], np.uint32)).reshape(-1, 3).astype(np.int64)
    if not len(cut):
        return _fans(mesh, np.array([polygon]))
    a, b, c = (flat[cut[:, i]] for i in range(3))
    clockwise = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum() < 0
    return corners[cut[:, ::-1] if clockwise else cut], np.full(len(cut), polygon)


def _on_plane(points: NDArray[np.float64], normal: Vectors) -> NDArray[np.float64]:
    """(N, 2) the points without the coordinate along which `normal` is longest, still counter-clockwise."""
    axis = int(np.abs(normal).argmax())
    plane = points[:, [(axis + 1) % 3, (axis + 2) % 3]] - points[0, [(axis + 1) % 3, (axis + 2) % 3]]
    return np.ascontiguousarray(plane if normal[axis] >= 0 else plane[:, ::-1])
