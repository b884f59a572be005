"""The geometry of a whole scene in render space: triangles with their object, polygon and corners."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, Ids, Vectors, column_major, cross, row_blocks, take_rows, unit
from illumcli.geometry.bounds import ObjectBounds, object_bounds, transformed_blocks
from illumcli.geometry.corner_normals import CornerNormals
from illumcli.geometry.corner_normals import corner_normals as mesh_corner_normals
from illumcli.geometry.extent import extents
from illumcli.geometry.instances import Instances, instance_matrices, instances, shared_meshes
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.polygon_normals import polygon_normals as mesh_polygon_normals
from illumcli.geometry.polygon_normals import reversed_polygons
from illumcli.geometry.transforms import cofactors, transform_matrix
from illumcli.geometry.triangulate import triangulate
from illumcli.records import Record
from illumcli.render_space import RenderSpace


class PlacedMesh(Record):
    """A mesh in render space, of one object, or in a space of its own, of objects that share it.

    It tells where the mesh's elements begin among all that are stored.
    """

    object: int  # the only object that has it, or the first one
    mesh: Mesh
    matrix: NDArray[np.float64]  # (4, 4) mesh to scene; of a shared mesh a mirror image, or the mesh itself
    space: RenderSpace  # of its vertices: that of the scene, or its own
    mirrored: bool  # the matrix turns left into right: corners run the other way round
    reversed: NDArray[np.bool_] | None  # (P,) polygons turned round to the side of the file's normals
    first_vertex: int
    first_corner: int
    first_polygon: int
    first_triangle: int


class SceneGeometry(Record):
    """All triangles of the scene, in radii from its centre. Arrays are read-only.

    A mesh that several objects share is stored once, after all others, in a space of its own. A place on the
    surface is an object and a stored triangle.
    """

    render_space: RenderSpace
    placed: tuple[PlacedMesh, ...]
    vertices: NDArray[np.float32]  # (V, 3), exactly as Embree has them
    triangles: NDArray[np.int32]  # (T, 3) vertex numbers
    corners: NDArray[np.int32]  # (T, 3) corner numbers, for normals and uv
    polygons: NDArray[np.int32]  # (T,) polygon numbers
    objects: NDArray[np.int32]  # (T,) object numbers, -1 for triangles that objects share
    matrices: NDArray[np.float64]  # (O, 4, 4) object to scene
    placed_mesh: NDArray[np.int32]  # (O,) index in `placed`
    first_number: NDArray[np.int64]  # (O,) number of the object's first triangle if none were shared
    instances: Instances | None = None  # None if no objects share a mesh

    def __post_init__(self) -> None:
        for array in vars(self).values():
            if isinstance(array, np.ndarray):
                array.setflags(write=False)

    @property
    def triangle_count(self) -> int:
        """Number of triangles of all objects, shared ones counted for each object."""
        sizes = np.diff([*(placed.first_triangle for placed in self.placed), len(self.triangles)])
        return int(sizes.take(self.placed_mesh).sum()) if len(sizes) else 0

    def objects_of(self, triangle: Ids, instance: Ids) -> Ids:
        """(N,) object of each hit, given by its stored triangle and its instance, -1 where that is none."""
        own = self.objects.take(triangle, mode="wrap")
        if self.instances is None:
            return own
        return np.where(instance < 0, own, self.instances.object.take(instance, mode="wrap"))

    def triangle_numbers(self, objects: Ids, triangle: Ids) -> NDArray[np.int64]:
        """(N,) number of each object's triangle among those of all objects."""
        first = np.array([placed.first_triangle for placed in self.placed], np.int64)
        within = triangle - first.take(self.placed_mesh).take(objects)
        return np.asarray(self.first_number.take(objects) + within)

    def positions(self, objects: Ids, points: Vectors) -> Vectors:
        """(N, 3) stored points of objects, in render space."""
        of = self.instances
        return points if of is None else of.positions(of.number.take(objects), points)

    def corner_positions(self, objects: Ids, triangle: Ids, k: int) -> NDArray[np.float64]:
        """(N, 3) positions [radii] of corner k of stored triangles of objects."""
        points = take_rows(self.vertices, self.triangles[:, k].take(triangle))
        exact: NDArray[np.float64] = column_major(points, np.float64)
        return np.asarray(self.positions(objects, exact), np.float64)

    def unit_normals(self, objects: Ids, n: Vectors) -> Vectors:
        """(N, 3) stored unit normals of objects, in render space."""
        of = self.instances
        return n if of is None else of.normals(of.number.take(objects), n)

    def unit_directions(self, objects: Ids, d: Vectors) -> Vectors:
        """(N, 3) stored unit directions along the surface of objects, in render space."""
        of = self.instances
        return d if of is None else of.directions(of.number.take(objects), d)

    def offset_edges(self, objects: Ids, edge: Floats) -> Floats:
        """(N,) lengths of edges, but at least what the ray offsets of instances are proportional to."""
        of = self.instances
        return edge if of is None else of.edges(of.number.take(objects), edge)


class CornerVectors(Record):
    """A vector per stored corner, kept once where corners share it."""

    values: NDArray[np.float32]  # (K, 3) or (K, 2)
    index: NDArray[np.int32]  # (C,) row of `values`, -1 where the corner has none


class PolygonCentres(Record):
    """Centres and corners of the P stored polygons. Arrays are read-only."""

    position: NDArray[np.float32]  # (P, 3) mean of the corners, as stored
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
    gone = {number: meshes[number] for number in culled}
    empty = {key: without_polygons(mesh) for key, mesh in {id(each): each for each in gone.values()}.items()}
    return tuple(empty[id(mesh)] if number in gone else mesh for number, mesh in enumerate(meshes))


def bounds_of(transforms: Sequence[Any], meshes: Sequence[Mesh]) -> ObjectBounds:
    """The bounds of mesh i under transform i (`scene.spec.Transform`)."""
    of_mesh = extents(meshes)
    matrices = [
        transform_matrix(transform, mesh, of_mesh.get(id(mesh)))
        for transform, mesh in zip(transforms, meshes, strict=True)
    ]
    return object_bounds(meshes, matrices, of_mesh)


def place_meshes(meshes: Sequence[Mesh], matrices: Sequence[NDArray[np.float64]]) -> SceneGeometry:
    """The triangles of mesh i under matrix i, in the render space of them all; none is shared."""
    return scene_geometry([True] * len(meshes), range(len(meshes)), meshes, object_bounds(meshes, matrices))


class _Stored(Record):
    """A mesh to store: of which object, under which matrix, in which space."""

    object: int
    mesh: Mesh
    matrix: NDArray[np.float64]
    space: RenderSpace


def scene_geometry(
    by_file: Sequence[bool], kinds: Sequence[int], meshes: Sequence[Mesh], object_bounds: ObjectBounds
) -> SceneGeometry:
    """The triangles of all meshes, in render space.

    Triangles run counter-clockwise seen from outside: those of mirrored objects are turned round, and those
    of polygons that run clockwise about their file's normals. Transforms are applied in float64, before
    anything is rounded to float32.

    Parameters
    ----------
    by_file : sequence of bool
        Of which objects the file's normals are used.
    kinds : sequence of int
        Equal for objects that may share a mesh; see `instances.shared_meshes`.
    """
    # Meshes of one object each, then those that several share; a culled object has a mesh without polygons.
    render_space, matrices = object_bounds.render_space, object_bounds.matrices
    groups = [
        ([i for i in group.objects if meshes[i].polygon_count], group.mirrored)
        for group in shared_meshes(kinds, matrices, object_bounds.most_corners)
    ]
    shares = [(members, mirrored) for members, mirrored in groups if members]
    sharing = {i for members, _ in shares for i in members}
    stored = [
        _Stored(i, mesh, matrix, render_space)
        for i, (mesh, matrix) in enumerate(zip(meshes, matrices, strict=True))
        if i not in sharing
    ]
    placed_mesh = np.zeros(len(meshes), np.int32)
    placed_mesh[[each.object for each in stored]] = np.arange(len(stored))
    every = np.array(matrices).reshape(-1, 4, 4)
    objects: list[int] = []
    to_render = [np.zeros((0, 3, 4))]
    for members, mirrored in shares:
        own = _own_space(members[0], meshes[members[0]], mirrored)
        placed_mesh[members] = len(stored)
        stored.append(own)
        objects += members
        to_render.append(instance_matrices(every[members] @ own.matrix, own.space, render_space))
    of_instances = np.array(objects, np.int32)
    shared = instances(len(meshes), of_instances, placed_mesh[of_instances], np.concatenate(to_render))
    return _geometry(by_file, stored, render_space, every, placed_mesh, shared)


def _own_space(number: int, mesh: Mesh, mirrored: bool) -> _Stored:
    """A mesh that objects share, or its mirror image, in a space of its own."""
    matrix = np.diag([-1.0 if mirrored else 1.0, 1.0, 1.0, 1.0])
    return _Stored(number, mesh, matrix, object_bounds([mesh], [matrix]).render_space)


def _geometry(
    by_file: Sequence[bool],
    stored: Sequence[_Stored],
    render_space: RenderSpace,
    matrices: NDArray[np.float64],
    placed_mesh: NDArray[np.int32],
    shared: Instances | None,
) -> SceneGeometry:
    """The triangles of all stored meshes, each triangulated once, however many objects have it."""
    meshes = [each.mesh for each in stored]
    of_mesh = {id(mesh): mesh for mesh in meshes}
    cuts = {key: triangulate(mesh) for key, mesh in of_mesh.items()}
    sides = {id(each.mesh): each.mesh for each in stored if by_file[each.object]}
    against_file = {key: reversed_polygons(mesh) for key, mesh in sides.items()}
    vertices = np.empty((sum(len(mesh.vertices) for mesh in meshes), 3), F, order="F")
    count = sum(len(cuts[id(mesh)].polygon) for mesh in meshes)
    triangles, corners = (np.empty((count, 3), np.int32, order="F") for _ in range(2))
    polygons, objects = (np.empty(count, np.int32) for _ in range(2))

    placed: list[PlacedMesh] = []
    first_vertex = first_corner = first_polygon = first_triangle = 0
    for each in stored:
        mesh, matrix, cut = each.mesh, each.matrix, cuts[id(each.mesh)]
        mirrored = bool(np.linalg.det(matrix[:3, :3]) < 0)
        against = against_file[id(mesh)] if by_file[each.object] else None
        firsts = first_vertex, first_corner, first_polygon, first_triangle
        placed.append(PlacedMesh(each.object, mesh, matrix, each.space, mirrored, against, *firsts))

        # The mesh's elements, numbered after those of the meshes before it, its triangles oriented.
        for rows, points in transformed_blocks(mesh, matrix):
            vertices[first_vertex + rows.start : first_vertex + rows.stop] = each.space.from_world(points)
        own = slice(first_triangle, first_triangle + len(cut.polygon))
        for rows in row_blocks(len(cut.polygon)):
            oriented = cut.corners[rows, ::-1] if mirrored else cut.corners[rows]
            if against is not None:
                oriented = np.where(against[cut.polygon[rows]][:, None], oriented[:, ::-1], oriented)
            there = slice(first_triangle + rows.start, first_triangle + rows.stop)
            np.add(mesh.corners[oriented], np.int32(first_vertex), out=triangles[there])
            np.add(oriented, np.int32(first_corner), out=corners[there])
        np.add(cut.polygon, np.int32(first_polygon), out=polygons[own])
        is_shared = shared is not None and shared.number[each.object] >= 0
        objects[own] = -1 if is_shared else each.object
        first_vertex += len(mesh.vertices)
        first_corner += len(mesh.corners)
        first_polygon += mesh.polygon_count
        first_triangle = own.stop

    # Numbers of all triangles, object by object.
    sizes = np.array([len(cuts[id(mesh)].polygon) for mesh in meshes], np.int64)
    of_objects = sizes.take(placed_mesh) if len(sizes) else np.zeros(0, np.int64)
    first_number = np.cumsum(of_objects) - of_objects
    arrays = vertices, triangles, corners, polygons, objects
    return SceneGeometry(render_space, tuple(placed), *arrays, matrices, placed_mesh, first_number, shared)


def scene_normals(geometry: SceneGeometry, normals: Sequence[CornerNormals]) -> CornerVectors:
    """Unit shading normals of every stored corner, from those of each placed mesh, in its space."""
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


def corner_normals(how: Sequence[Any], geometry: SceneGeometry) -> CornerVectors:
    """Shading normals of every stored corner, in the directions of its mesh's space.

    Parameters
    ----------
    how : sequence
        Of each object: `flat` for its polygons' own, what its file's description says
        (`scene.spec.Normals`), or None for the mesh's own.
    """
    # Objects that share a mesh share its normals; those that are `flat` read none.
    of_placed: dict[int, Any] = {}
    for number, says in zip(geometry.placed_mesh.tolist(), how, strict=True):
        if of_placed.get(number, "flat") == "flat":
            of_placed[number] = says
    known: dict[tuple[int, str, bool], CornerNormals] = {}
    of_meshes = []
    for number, placed in enumerate(geometry.placed):
        mesh, says = placed.mesh, of_placed[number]
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
        of_meshes.append(known[key])
    return scene_normals(geometry, of_meshes)


def polygon_normals(methods: Sequence[Any], geometry: SceneGeometry) -> NDArray[np.float32]:
    """(P, 3) unit normal of every stored polygon, by each object's method, in its mesh's space."""
    parts = []
    for placed in geometry.placed:
        transformed = (
            mesh_polygon_normals(placed.mesh, methods[placed.object]) @ cofactors(placed.matrix[:3, :3]).T
        )
        size = np.linalg.norm(transformed, axis=1, keepdims=True)
        sign: Any = -1 if placed.mirrored else 1
        if placed.reversed is not None:
            sign = np.where(placed.reversed, -sign, sign)[:, None]
        zero = np.zeros_like(transformed)
        parts.append(np.divide(sign * transformed, size, out=zero, where=size > 0))
    return column_major(_concatenated(parts, np.zeros((0, 3))), F)


def triangle_normals(geometry: SceneGeometry) -> Vectors:
    """(T, 3) float32 unit normals of all stored triangles, in the directions of their mesh's space."""
    a, b, c = triangle_corners(geometry.vertices, geometry.triangles)
    return column_major(unit(cross(b - a, c - a)), F)


def polygon_centres(geometry: SceneGeometry) -> PolygonCentres:
    """Centres and corners of all stored polygons."""
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
