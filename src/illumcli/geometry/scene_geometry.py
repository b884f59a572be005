"""Places a scene's meshes in one World: triangles of unit radius with their object, material and corners."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Vectors, column_major, take_rows
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.normals import reversed_polygons
from illumcli.geometry.triangulate import triangulate
from illumcli.records import Record
from illumcli.render_space import RenderSpace


class PlacedMesh(Record):
    """One object of the scene: a mesh, where it stands, and its numbers in the World."""

    mesh: Mesh
    matrix: NDArray[np.float64]  # (4, 4), object to scene
    mirrored: bool  # the matrix turns left into right: corners run the other way round
    reversed: NDArray[np.bool_] | None  # (P,) polygons turned round to the side of the file's normals
    first_vertex: int
    first_corner: int
    first_polygon: int
    first_triangle: int


class ObjectBounds(Record):
    """Where every object stands: known before any of them is cut in triangles."""

    matrices: tuple[NDArray[np.float64], ...]  # (4, 4) each, object to scene
    low: NDArray[np.float64]  # (O, 3) corner of what its polygons use [scene units]; inf without polygons
    high: NDArray[np.float64]  # (O, 3); -inf without polygons
    polygons: NDArray[np.int64]  # (O,) how many
    frame: RenderSpace


class SceneGeometry(Record):
    """All triangles of the scene, in radii from its centre. Arrays are read-only."""

    frame: RenderSpace
    placed: tuple[PlacedMesh, ...]
    vertices: NDArray[np.float32]  # (V, 3), exactly what the ray core sees
    triangles: NDArray[np.int32]  # (T, 3) vertex numbers
    corners: NDArray[np.int32]  # (T, 3) corner numbers, for normals and uv
    polygons: NDArray[np.int32]  # (T,) polygon numbers
    objects: NDArray[np.int32]  # (T,) object numbers

    def __post_init__(self) -> None:
        for array in (self.vertices, self.triangles, self.corners, self.polygons, self.objects):
            array.setflags(write=False)


def triangle_corners(
    vertices: NDArray[np.float32], triangles: NDArray[np.int32]
) -> tuple[Vectors, Vectors, Vectors]:
    """(T, 3) float64 each: the three corners of every triangle, components contiguous."""
    a, b, c = (column_major(take_rows(vertices, triangles[:, k]), np.float64) for k in range(3))
    return a, b, c


def transform_matrix(transform: Any, mesh: Mesh) -> NDArray[np.float64]:
    """(4, 4) float64: scale, rotate about x, y, z, fit, translate, then the scene's own matrix."""
    matrix = np.diag([*transform.scale, 1.0])
    for axis, degrees in enumerate(transform.rotate):
        matrix = rotation(axis, degrees) @ matrix
    if transform.fit is not None and len(mesh.corners):
        low, high = bounds(among_used(mesh, mesh.vertices) @ matrix[:3, :3].T)
        size = transform.fit / (np.linalg.norm((high - low) / 2) or 1.0)
        matrix[:3, :3] *= size
        matrix[:3, 3] = -size * np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    matrix[:3, 3] += transform.translate
    return matrix if transform.matrix is None else np.asarray(transform.matrix, np.float64) @ matrix


def rotation(axis: int, degrees: float) -> NDArray[np.float64]:
    """(4, 4) right-handed rotation about a coordinate axis; quarter turns are exact."""
    quarter, rest = divmod(degrees, 90.0)
    cosine, sine = np.cos(np.radians(rest)), np.sin(np.radians(rest))
    for _ in range(int(quarter) % 4):
        cosine, sine = -sine, cosine
    i, j = ((1, 2), (2, 0), (0, 1))[axis]
    matrix = np.eye(4)
    matrix[i, i] = matrix[j, j] = cosine
    matrix[j, i], matrix[i, j] = sine, -sine
    return matrix


def bounds(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest corner of the points' box; a point at the origin where there are none."""
    if not len(points):
        return np.zeros(3), np.zeros(3)
    # a column at a time: along the other axis numpy goes three numbers at a time
    low, high = ([reach(column) for column in points.T] for reach in (np.min, np.max))
    return np.array(low), np.array(high)


def among_used(mesh: Mesh, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points of those of the mesh's vertices that some polygon has."""
    mask = used(mesh)
    return points if mask.all() else points[mask]


def used(mesh: Mesh) -> NDArray[np.bool_]:
    """(V,) True for the vertices that some polygon has."""
    mask = np.zeros(len(mesh.vertices), np.bool_)
    mask[mesh.corners] = True
    return mask


def stand(meshes: Sequence[Mesh], matrices: Sequence[NDArray[np.float64]]) -> ObjectBounds:
    """Mesh i under matrix i; the frame's box holds them all, with its centre at 0 and half its diagonal 1."""
    low, high = np.full((len(meshes), 3), np.inf), np.full((len(meshes), 3), -np.inf)
    for number, (mesh, matrix) in enumerate(zip(meshes, matrices, strict=True)):
        if len(mesh.corners):
            low[number], high[number] = bounds(among_used(mesh, moved(mesh, matrix)))
    lowest, highest = low.min(axis=0, initial=np.inf), high.max(axis=0, initial=-np.inf)
    if not np.isfinite(lowest).all():
        lowest, highest = np.zeros(3), np.zeros(3)
    centre = (lowest + highest) / 2
    radius = float(np.linalg.norm((highest - lowest) / 2)) or 1.0
    frame = RenderSpace((float(centre[0]), float(centre[1]), float(centre[2])), radius)
    polygons = np.array([mesh.polygon_count for mesh in meshes], np.int64)
    return ObjectBounds(tuple(matrices), low, high, polygons, frame)


def moved(mesh: Mesh, matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """(V, 3) vertices where they stand in the scene."""
    out: NDArray[np.float64] = mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]
    return out


def widest_polygon(mesh: Mesh, matrix: NDArray[np.float64]) -> float:
    """The largest diagonal of a polygon's box in the scene; 0 where all polygons and normals of the mesh
    agree on one of its own axes, as those of a floor do."""
    if not mesh.polygon_count:
        return 0.0
    low, high = bounds(among_used(mesh, mesh.vertices))
    across = low < high
    if not across.all() and (mesh.normals is None or not mesh.normals[:, across].any()):
        return 0.0
    corners, first = moved(mesh, matrix)[mesh.corners], mesh.starts[:-1]
    size = np.maximum.reduceat(corners, first, axis=0) - np.minimum.reduceat(corners, first, axis=0)
    return float(np.sqrt(np.square(size).sum(axis=1).max()))


def without_polygons(mesh: Mesh) -> Mesh:
    """The mesh with all its names and nothing that can be seen."""
    per_corner: dict[str, Any] = {
        name: None if (rows := getattr(mesh, name)) is None else rows[:0]
        for name in (
            "corner_normals",
            "corner_uvs",
            "polygon_materials",
            "polygon_groups",
            "polygon_smoothing",
        )
    }
    return replace(
        mesh,
        vertices=mesh.vertices[:0],
        corners=mesh.corners[:0],
        starts=np.zeros(1, np.int32),
        attributes={name: values[:0] for name, values in mesh.attributes.items()},
        repairs={},
        **per_corner,
    )


def place(
    meshes: Sequence[Mesh],
    matrices: Sequence[NDArray[np.float64]],
    frame: RenderSpace | None = None,
    by_file: Sequence[bool] | None = None,
) -> SceneGeometry:
    """Mesh i under matrix i, all in one World of unit radius: in `frame`, or in that of all these meshes.

    Triangles run counter-clockwise seen from outside: those of mirrored objects and of polygons that run
    clockwise about their file's normals are turned round; `by_file` says of which objects these normals are
    used, by default of all. The move and the scaling happen in float64, before
    anything is rounded to float32.
    """
    frame = frame or stand(meshes, matrices).frame
    placed, vertices, triangles, corners, polygons, objects = [], [], [], [], [], []
    first = {"vertex": 0, "corner": 0, "polygon": 0, "triangle": 0}
    for number, (mesh, matrix) in enumerate(zip(meshes, matrices, strict=True)):
        cut = triangulate(mesh)
        mirrored = bool(np.linalg.det(matrix[:3, :3]) < 0)
        own = cut.corners[:, ::-1] if mirrored else cut.corners
        against = reversed_polygons(mesh) if by_file is None or by_file[number] else None
        if against is not None:
            own = np.where(against[cut.polygon][:, None], own[:, ::-1], own)
        placed.append(PlacedMesh(mesh, matrix, mirrored, against, *first.values()))
        vertices.append(moved(mesh, matrix))
        triangles.append(mesh.corners[own] + np.int32(first["vertex"]))
        corners.append(own + np.int32(first["corner"]))
        polygons.append(cut.polygon + np.int32(first["polygon"]))
        objects.append(np.full(len(own), number, np.int32))
        first["vertex"] += len(mesh.vertices)
        first["corner"] += len(mesh.corners)
        first["polygon"] += mesh.polygon_count
        first["triangle"] += len(own)
    return SceneGeometry(
        frame=frame,
        placed=tuple(placed),
        vertices=column_major(_joined([frame.from_world(v) for v in vertices], np.zeros((0, 3))), F),
        triangles=column_major(_joined(triangles, np.zeros((0, 3), np.int32))),
        corners=column_major(_joined(corners, np.zeros((0, 3), np.int32))),
        polygons=_joined(polygons, np.zeros(0, np.int32)),
        objects=_joined(objects, np.zeros(0, np.int32)),
    )


def _joined(arrays: list[NDArray[Any]], empty: NDArray[Any]) -> NDArray[Any]:
    return np.concatenate(arrays) if arrays else empty


class CornerVectors(Record):
    """A vector per corner of the World, kept once where corners share it."""

    values: NDArray[np.float32]  # (K, 3) or (K, 2)
    index: NDArray[np.int32]  # (C,) row of `values`, -1 where the corner has none


def world_normals(world: SceneGeometry, normals: Sequence[Any]) -> CornerVectors:
    """Unit shading normals of every corner in scene directions, from each object's own
    (`geometry.normals.CornerNormals`), by the inverse transpose of its matrix."""
    values, index, first = [], [], 0
    for placed, own in zip(world.placed, normals, strict=True):
        linear = placed.matrix[:3, :3]
        scale = np.abs(linear).max() or 1.0
        turned = own.normals @ cofactors(linear / scale).T
        if placed.mirrored:
            turned = -turned
        size = np.linalg.norm(turned, axis=1, keepdims=True)
        values.append(np.divide(turned, size, out=np.zeros_like(turned), where=size > 0))
        index.append(np.where(own.index >= 0, own.index + first, -1).astype(np.int32))
        first += len(own.normals)
    return CornerVectors(
        column_major(_joined(values, np.zeros((0, 3))), F), _joined(index, np.zeros(0, np.int32))
    )


def cofactors(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """(3, 3) cofactor matrix: det times the inverse transpose, defined for singular matrices too."""
    a, b, c = matrix
    return np.array([np.cross(b, c), np.cross(c, a), np.cross(a, b)])


def world_uvs(world: SceneGeometry) -> CornerVectors:
    """Texture coordinates of every corner; -1 where a mesh has none."""
    values, index, first = [], [], 0
    for placed in world.placed:
        mesh = placed.mesh
        if mesh.uvs is None or mesh.corner_uvs is None:
            index.append(np.full(len(mesh.corners), -1, np.int32))
            continue
        values.append(mesh.uvs)
        index.append(np.where(mesh.corner_uvs >= 0, mesh.corner_uvs + first, -1).astype(np.int32))
        first += len(mesh.uvs)
    return CornerVectors(
        column_major(_joined(values, np.zeros((0, 2))), F), _joined(index, np.zeros(0, np.int32))
    )


class PolygonCentres(Record):
    """The P polygons of a World as wholes. Arrays are read-only."""

    position: NDArray[np.float32]  # (P, 3) mean of the corners, in radii
    starts: NDArray[np.int32]  # (P + 1,) number of each polygon's first corner, and the end
    vertex: NDArray[np.int32]  # (C,) vertex number of each corner

    def __post_init__(self) -> None:
        for array in (self.position, self.starts, self.vertex):
            array.setflags(write=False)


def polygon_centres(world: SceneGeometry) -> PolygonCentres:
    """Centres and corners of all polygons."""
    centres, vertices, starts = [], [np.zeros(0, np.int32)], [np.zeros(1, np.int32)]
    for placed in world.placed:
        mesh = placed.mesh
        if not mesh.polygon_count:
            continue
        vertices.append(mesh.corners + np.int32(placed.first_vertex))
        starts.append(mesh.starts[1:] + np.int32(placed.first_corner))
        points = world.vertices[vertices[-1]].astype(np.float64)
        sums = np.add.reduceat(points, mesh.starts[:-1], axis=0)
        centres.append(sums / np.diff(mesh.starts)[:, None])
    position = column_major(_joined(centres, np.zeros((0, 3))), F)
    return PolygonCentres(position, np.concatenate(starts), np.concatenate(vertices))
