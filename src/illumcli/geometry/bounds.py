"""Bounding boxes: known before any object is triangulated."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import BLOCK_ROWS, row_blocks
from illumcli.geometry.extent import Extent, box_corners, extents, take_used, used_vertices
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.polygon_normals import blocks
from illumcli.records import Record
from illumcli.render_space import RenderSpace

SQRT3 = 3**0.5
"""Greatest ratio of the diagonal of a box around points to the distance of two of them."""


class ObjectBounds(Record):
    """Transform and bounding box of the polygons of each of O objects, and the render space of all."""

    matrices: tuple[NDArray[np.float64], ...]  # (4, 4) each, object to scene
    low: NDArray[
        np.float64
    ]  # (O, 3) lowest corner of each box [scene units]; inf for an object without polygons
    high: NDArray[np.float64]  # (O, 3) highest corner; -inf without polygons
    polygons: NDArray[np.int64]  # (O,) number of polygons
    most_corners: NDArray[np.int64]  # (O,) of any polygon
    render_space: RenderSpace


def object_bounds(
    meshes: Sequence[Mesh],
    matrices: Sequence[NDArray[np.float64]],
    known: Mapping[int, Extent] | None = None,
) -> ObjectBounds:
    """The bounds of mesh i under matrix i; `known` are the meshes' `extents`, if they are.

    The render space has the centre of the box around all objects, and half its diagonal as its radius.
    """
    # A box for each object.
    of_mesh = extents(meshes) if known is None else known
    low, high = np.full((len(meshes), 3), np.inf), np.full((len(meshes), 3), -np.inf)
    for mesh, numbers in _objects_of_meshes(meshes):
        if extent := of_mesh.get(id(mesh)):
            for number in numbers:
                matrix = matrices[number]
                low[number], high[number] = extent.box(matrix[:3, :3], matrix[:3, 3])
        elif len(mesh.corners):
            for some in _together(mesh, numbers):
                places = np.stack([matrices[number] for number in some])
                low[some], high[some] = _transformed_boxes(mesh, places)

    # The box around all of them; a point at the origin where there are no polygons.
    lowest, highest = low.min(axis=0, initial=np.inf), high.max(axis=0, initial=-np.inf)
    if not np.isfinite(lowest).all():
        lowest, highest = np.zeros(3), np.zeros(3)
    centre = (lowest + highest) / 2
    radius = float(np.linalg.norm((highest - lowest) / 2)) or 1.0
    render_space = RenderSpace((float(centre[0]), float(centre[1]), float(centre[2])), radius)
    polygons = np.array([mesh.polygon_count for mesh in meshes], np.int64)
    of_distinct = {id(mesh): mesh for mesh in meshes}
    most = {key: int(np.diff(mesh.starts).max(initial=0)) for key, mesh in of_distinct.items()}
    most_corners = np.array([most[id(mesh)] for mesh in meshes], np.int64)
    return ObjectBounds(tuple(matrices), low, high, polygons, most_corners, render_space)


def _objects_of_meshes(meshes: Sequence[Mesh]) -> list[tuple[Mesh, list[int]]]:
    """Each distinct mesh, and the numbers of the objects that have it."""
    numbers: dict[int, list[int]] = {}
    for number, mesh in enumerate(meshes):
        numbers.setdefault(id(mesh), []).append(number)
    return [(meshes[each[0]], each) for each in numbers.values()]


def _together(mesh: Mesh, numbers: list[int]) -> Iterator[list[int]]:
    """The objects of a mesh, so many at a time that their vertices fill a block."""
    step = max(1, BLOCK_ROWS // max(len(mesh.vertices), 1))
    for first in range(0, len(numbers), step):
        yield numbers[first : first + step]


def _transformed_boxes(
    mesh: Mesh, matrices: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest corners, (O, 3) each, of the boxes around all vertices in polygons [scene units]
    under each of (O, 4, 4) matrices."""
    used = used_vertices(mesh)
    low, high = np.full((len(matrices), 3), np.inf), np.full((len(matrices), 3), -np.inf)
    for rows in row_blocks(len(mesh.vertices)):
        if not used[rows].any():
            continue
        points = mesh.vertices[rows] @ matrices[:, :3, :3].transpose(0, 2, 1)
        points = points.transpose(2, 0, 1)[:, :, used[rows]] + matrices[:, :3, 3].T[:, :, None]
        np.minimum(low, points.min(axis=2).T, out=low)
        np.maximum(high, points.max(axis=2).T, out=high)
    return low, high


def transformed_vertices(mesh: Mesh, matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """(V, 3) vertices in the scene [scene units]."""
    out: NDArray[np.float64] = mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    return out


def transformed_blocks(
    mesh: Mesh, matrix: NDArray[np.float64]
) -> Iterator[tuple[slice, NDArray[np.float64]]]:
    """Blocks of vertices, and their positions in the scene, (N, 3) [scene units]."""
    for rows in row_blocks(len(mesh.vertices)):
        yield rows, mesh.vertices[rows] @ matrix[:3, :3].T + matrix[:3, 3]


def widest_polygon(mesh: Mesh, matrix: NDArray[np.float64]) -> float:
    """The largest diagonal of a polygon's bounding box [scene units].

    0 for a mesh that is flat across one of its own axes and whose normals all point along it, such as a
    floor: it does not approximate a curved surface.
    """
    if not mesh.polygon_count:
        return 0.0
    low, high = box_corners(take_used(mesh, mesh.vertices))
    extends = low < high
    if not extends.all() and (mesh.normals is None or not mesh.normals[:, extends].any()):
        return 0.0
    vertices, largest = transformed_vertices(mesh, matrix), 0.0
    for _, _, part in blocks(mesh):
        corners, first = vertices[part.corners], part.starts[:-1]
        size = np.maximum.reduceat(corners, first, axis=0) - np.minimum.reduceat(corners, first, axis=0)
        largest = max(largest, float(np.square(size).sum(axis=1).max()))
    return float(np.sqrt(largest))


def implied_widths(
    flat: Sequence[bool], meshes: Sequence[Mesh], object_bounds: ObjectBounds
) -> NDArray[np.float64]:
    """(O,) largest polygon diagonal of each object whose normals imply a smooth surface, otherwise 0.

    It is an upper bound on the shadow-ray offset of each object [scene units]. For a mesh of several objects
    it is larger than needed: its widest polygon, turned and stretched as if it were the diagonal of a cube.
    """
    count = Counter(map(id, meshes))
    shared = {key: mesh for mesh in meshes if count[key := id(mesh)] > 1}
    widest = {key: SQRT3 * widest_polygon(mesh, np.eye(4)) for key, mesh in shared.items()}
    widths = np.zeros(len(meshes))
    smooth = [number for number, is_flat in enumerate(flat) if not is_flat]
    several = [number for number in smooth if id(meshes[number]) in widest]
    if several:
        linear = np.stack([object_bounds.matrices[number][:3, :3] for number in several])
        stretch = np.linalg.norm(linear, 2, axis=(1, 2))
        widths[several] = [widest[id(meshes[number])] for number in several] * stretch
    for number in smooth:
        if id(meshes[number]) not in widest:
            widths[number] = widest_polygon(meshes[number], object_bounds.matrices[number])
    return widths
