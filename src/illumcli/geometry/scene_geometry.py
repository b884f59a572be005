"""The geometry of a whole scene in render space: triangles with their object, polygon and corners."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Vectors, column_major, cross, row_blocks, take_rows, unit
from illumcli.geometry.bounds import ObjectBounds, object_bounds, transformed_blocks
from illumcli.geometry.corner_normals import CornerNormals
from illumcli.geometry.corner_normals import corner_normals as mesh_corner_normals
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.polygon_normals import polygon_normals as mesh_polygon_normals
from illumcli.geometry.polygon_normals import reversed_polygons
from illumcli.geometry.transforms import cofactors, transform_matrix
from illumcli.geometry.triangulate import triangulate
from illumcli.records import Record
from illumcli.render_space import RenderSpace


class PlacedMesh(Record):
    """One object of the scene: a mesh, its transform, and where its elements begin among all."""

    mesh: Mesh
    matrix: NDArray[np.float64]  # (4, 4), object to scene
    mirrored: bool  # the matrix turns left into right: corners run the other way round
    reversed: NDArray[np.bool_] | None  # (P,) polygons turned round to the side of the file's normals
    first_vertex: int
    first_corner: int
    first_polygon: int
    first_triangle: int


class SceneGeometry(Record):
    """All triangles of the scene, in radii from its centre. Arrays are read-only."""

    render_space: RenderSpace
    placed: tuple[PlacedMesh, ...]
    vertices: NDArray[np.float32]  # (V, 3), exactly as Embree has them
    triangles: NDArray[np.int32]  # (T, 3) vertex numbers
    corners: NDArray[np.int32]  # (T, 3) corner numbers, for normals and uv
    polygons: NDArray[np.int32]  # (T,) polygon numbers
    objects: NDArray[np.int32]  # (T,) object numbers

    def __post_init__(self) -> None:
        for array in (self.vertices, self.triangles, self.corners, self.polygons, self.objects):
            array.setflags(write=False)


class CornerVectors(Record):
    """A vector per corner of the scene, kept once where corners share it."""

    values: NDArray[np.float32]  # (K, 3) or (K, 2)
    index: NDArray[np.int32]  # (C,) row of `values`, -1 where the corner has none


class PolygonCentres(Record):
    """Centres and corners of the scene's P polygons. Arrays are read-only."""

    position: NDArray[np.float32]  # (P, 3) mean of the corners, in radii
    starts: NDArray[np.int32]  # (P + 1,) number of each polygon's first corner, and the end
    vertex: NDArray[np.int32]  # (C,) vertex number of each corner

    def __post_init__(self) -> None:
        for array in (self.position, self.starts, self.vertex):
            array.setflags(write=False)


def triangle_corners(
    vertices: NDArray[np.float32], triangles: NDArray[np.int32]
) -> tuple[Vectors, Vectors, Vectors]:
    """(T, 3) float64 each: the three corners of every triangle, components contiguous."""
    a, b, c = (column_major(take_rows(vertices, triangles[:, k]), np.float64) for k in range(3))
    return a, b, c


def without_polygons(mesh: Mesh) -> Mesh:
    """The mesh with all its names and no geometry, as a culled object has it."""
    per_corner: dict[str, Any] = {
        name: None if (values := getattr(mesh, name)) is None else values[:0]
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


def without_culled(culled: Collection[int], meshes: Sequence[Mesh]) -> tuple[Mesh, ...]:
    """The meshes, those of culled objects (by number) without their polygons."""
    gone = frozenset(culled)
    return tuple(without_polygons(mesh) if number in gone else mesh for number, mesh in enumerate(meshes))


def bounds_of(transforms: Sequence[Any], meshes: Sequence[Mesh]) -> ObjectBounds:
    """The bounds of mesh i under transform i (`scene.spec.Transform`)."""
    each = zip(transforms, meshes, strict=True)
    return object_bounds(meshes, [transform_matrix(transform, mesh) for transform, mesh in each])


def place_meshes(meshes: Sequence[Mesh], matrices: Sequence[NDArray[np.float64]]) -> SceneGeometry:
    """The triangles of mesh i under matrix i, in the render space of them all; see `scene_geometry`."""
    return scene_geometry([True] * len(meshes), meshes, object_bounds(meshes, matrices))


def scene_geometry(
    by_file: Sequence[bool], meshes: Sequence[Mesh], object_bounds: ObjectBounds
) -> SceneGeometry:
    """The triangles of all meshes, in render space.

    Triangles run counter-clockwise seen from outside: those of mirrored objects are turned round, and those
    of polygons that run clockwise about their file's normals. Transforms are applied in float64, before
    anything is rounded to float32.

    Parameters
    ----------
    by_file : sequence of bool
        Of which objects the file's normals are used.
    """
    # Triangulate each mesh once, however many objects have it.
    render_space, matrices = object_bounds.render_space, object_bounds.matrices
    of_mesh = {id(mesh): mesh for mesh in meshes}
    cuts = {key: triangulate(mesh) for key, mesh in of_mesh.items()}
    sides = {id(mesh): mesh for mesh, uses in zip(meshes, by_file, strict=True) if uses}
    against_file = {key: reversed_polygons(mesh) for key, mesh in sides.items()}
    vertices = np.empty((sum(len(mesh.vertices) for mesh in meshes), 3), F, order="F")
    count = sum(len(cuts[id(mesh)].polygon) for mesh in meshes)
    triangles, corners = (np.empty((count, 3), np.int32, order="F") for _ in range(2))
    polygons, objects = (np.empty(count, np.int32) for _ in range(2))

    placed: list[PlacedMesh] = []
    first_vertex = first_corner = first_polygon = first_triangle = 0
    for number, (mesh, matrix) in enumerate(zip(meshes, matrices, strict=True)):
        cut = cuts[id(mesh)]
        mirrored = bool(np.linalg.det(matrix[:3, :3]) < 0)
        against = against_file[id(mesh)] if by_file[number] else None
        placed.append(
            PlacedMesh(
                mesh, matrix, mirrored, against, first_vertex, first_corner, first_polygon, first_triangle
            )
        )

        # The object's elements, numbered after those of the objects before it, its triangles oriented.
        for rows, points in transformed_blocks(mesh, matrix):
            vertices[first_vertex + rows.start : first_vertex + rows.stop] = render_space.from_world(points)
        own = slice(first_triangle, first_triangle + len(cut.polygon))
        for rows in row_blocks(len(cut.polygon)):
            oriented = cut.corners[rows, ::-1] if mirrored else cut.corners[rows]
            if against is not None:
                oriented = np.where(against[cut.polygon[rows]][:, None], oriented[:, ::-1], oriented)
            there = slice(first_triangle + rows.start, first_triangle + rows.stop)
            np.add(mesh.corners[oriented], np.int32(first_vertex), out=triangles[there])
            np.add(oriented, np.int32(first_corner), out=corners[there])
        np.add(cut.polygon, np.int32(first_polygon), out=polygons[own])
        objects[own] = number
        first_vertex += len(mesh.vertices)
        first_corner += len(mesh.corners)
        first_polygon += mesh.polygon_count
        first_triangle = own.stop
    return SceneGeometry(render_space, tuple(placed), vertices, triangles, corners, polygons, objects)


def scene_normals(geometry: SceneGeometry, normals: Sequence[CornerNormals]) -> CornerVectors:
    """Unit shading normals of every corner in scene directions, from those of each object's mesh."""
    values = np.empty((sum(len(each.normals) for each in normals), 3), F, order="F")
    index, first = [], 0
    for placed, of_mesh in zip(geometry.placed, normals, strict=True):
        # Normals transform by the inverse transpose, up to a factor the cofactors; scaled against overflow.
        linear = placed.matrix[:3, :3]
        scale = np.abs(linear).max() or 1.0
        matrix = cofactors(linear / scale).T
        for rows in row_blocks(len(of_mesh.normals)):
            transformed = of_mesh.normals[rows] @ matrix
            if placed.mirrored:
                transformed = -transformed
            size = np.linalg.norm(transformed, axis=1, keepdims=True)
            values[first + rows.start : first + rows.stop] = np.divide(
                transformed, size, out=np.zeros_like(transformed), where=size > 0
            )
        index.append(_shifted(of_mesh.index, first))
        first += len(of_mesh.normals)
    return CornerVectors(values, _concatenated(index, np.zeros(0, np.int32)))


def scene_uvs(geometry: SceneGeometry) -> CornerVectors:
    """Texture coordinates of every corner; -1 where a mesh has none."""
    values, index, first = [], [], 0
    for placed in geometry.placed:
        mesh = placed.mesh
        if mesh.uvs is None or mesh.corner_uvs is None:
            index.append(np.full(len(mesh.corners), -1, np.int32))
            continue
        values.append(mesh.uvs)
        index.append(_shifted(mesh.corner_uvs, first))
        first += len(mesh.uvs)
    return CornerVectors(
        column_major(_concatenated(values, np.zeros((0, 2))), F), _concatenated(index, np.zeros(0, np.int32))
    )


def corner_normals(how: Sequence[Any], meshes: Sequence[Mesh], geometry: SceneGeometry) -> CornerVectors:
    """Shading normals of every corner of the scene.

    Parameters
    ----------
    how : sequence
        Of each object: `flat` for its polygons' own, what its file's description says
        (`scene.spec.Normals`), or None for the mesh's own.
    """
    # Objects that share a mesh share its normals.
    known: dict[tuple[int, str, bool], CornerNormals] = {}
    of_objects = []
    for mesh, says, placed in zip(meshes, how, geometry.placed, strict=True):
        key = (id(mesh), repr(says), placed.reversed is None)
        if key not in known:
            if says == "flat":
                known[key] = mesh_corner_normals(mesh, crease=0.0, use_file=False, turned=placed.reversed)
            elif says is not None:
                known[key] = mesh_corner_normals(
                    mesh, says.weights, says.crease, says.source == "file", says.polygon
                )
            else:
                known[key] = mesh_corner_normals(mesh)
        of_objects.append(known[key])
    return scene_normals(geometry, of_objects)


def polygon_normals(
    methods: Sequence[Any], meshes: Sequence[Mesh], geometry: SceneGeometry
) -> NDArray[np.float32]:
    """(P, 3) unit normal of every polygon, in scene directions, by each object's method."""
    parts = []
    for mesh, method, placed in zip(meshes, methods, geometry.placed, strict=True):
        transformed = mesh_polygon_normals(mesh, method) @ cofactors(placed.matrix[:3, :3]).T
        size = np.linalg.norm(transformed, axis=1, keepdims=True)
        sign: Any = -1 if placed.mirrored else 1
        if placed.reversed is not None:
            sign = np.where(placed.reversed, -sign, sign)[:, None]
        zero = np.zeros_like(transformed)
        parts.append(np.divide(sign * transformed, size, out=zero, where=size > 0))
    return column_major(_concatenated(parts, np.zeros((0, 3))), F)


def triangle_normals(geometry: SceneGeometry) -> Vectors:
    """(T, 3) float32 unit normals of all triangles."""
    a, b, c = triangle_corners(geometry.vertices, geometry.triangles)
    return column_major(unit(cross(b - a, c - a)), F)


def polygon_centres(geometry: SceneGeometry) -> PolygonCentres:
    """Centres and corners of all polygons."""
    centres, vertices, starts = [], [np.zeros(0, np.int32)], [np.zeros(1, np.int32)]
    for placed in geometry.placed:
        mesh = placed.mesh
        if not mesh.polygon_count:
            continue
        vertices.append(mesh.corners + np.int32(placed.first_vertex))
        starts.append(mesh.starts[1:] + np.int32(placed.first_corner))
        points = geometry.vertices[vertices[-1]].astype(np.float64)
        sums = np.add.reduceat(points, mesh.starts[:-1], axis=0)
        centres.append(sums / np.diff(mesh.starts)[:, None])
    position = column_major(_concatenated(centres, np.zeros((0, 3))), F)
    return PolygonCentres(position, np.concatenate(starts), np.concatenate(vertices))


def _shifted(index: NDArray[np.int32], first: int) -> NDArray[np.int32]:
    """Rows counted from `first`; -1 stays."""
    return index if first == 0 else np.where(index >= 0, index + np.int32(first), np.int32(-1))


def _concatenated(arrays: list[NDArray[Any]], empty: NDArray[Any]) -> NDArray[Any]:
    """All arrays one after the other; a single one is not copied."""
    if len(arrays) == 1:
        return arrays[0]
    return np.concatenate(arrays) if arrays else empty
