"""Obscurance of meshes from files, at hits: values at corners, and textures over uv."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from illumcli.arrays import F, Floats, column_major
from illumcli.color import Space, Texels
from illumcli.errors import InputError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.scene_geometry import CornerVectors, SceneGeometry, scene_uvs
from illumcli.rays.corner_weights import CornerWeights
from illumcli.rays.interaction import uv_at
from illumcli.records import Record
from illumcli.shading.textures import FILTERS
from illumcli.visibility.baked_corners import BakedValues, Files, baked_obscurance, file_users
from illumcli.visibility.baked_meshes import User, file_vertices, is_of_one_object

Read: TypeAlias = Callable[[str, Space], Texels]
"""Path and colour space of a texture -> its image."""


class OcclusionMap(Record):
    """A texture of obscurance on some polygons of objects that share a mesh."""

    objects: NDArray[np.bool_]  # (O,)
    materials: NDArray[np.int32]  # (P,) material of each stored polygon in its file, -1 for none
    material: int
    uvs: CornerVectors
    image: Texels  # one channel
    filter: str = "bilinear"
    wrap: str = "repeat"
    strength: float = 1.0


class OcclusionMaps(Record):
    """The textures of obscurance of a scene."""

    maps: tuple[OcclusionMap, ...]
    has_file: NDArray[np.bool_]  # (O,) objects whose obscurance is that of a file


def occlusion_maps(
    files: Files,
    read: Read,
    geometry: SceneGeometry,
    obscurance_meshes: tuple[Mesh | None, ...] | None = None,
) -> OcclusionMaps:
    """The textures in files of obscurance: images, and occlusion textures of glTF.

    Parameters
    ----------
    files
        Name and file of each object.
    obscurance_meshes
        The meshes in those that are mesh files.

    Raises
    ------
    InputError
        An unreadable image, a mesh without uv, a file of another mesh; all of them in one error.
    """
    # Objects that share a mesh share its textures; those in a file of several objects go by name.
    sharing: dict[tuple[Path, int, str], tuple[Mesh | None, list[User]]] = {}
    for user, path, in_mesh in file_users(files, obscurance_meshes, in_textures=True):
        is_single = in_mesh is None or is_of_one_object(geometry, user.number, in_mesh)
        key = path, int(geometry.placed_mesh[user.number]), "" if is_single else user.name
        sharing.setdefault(key, (in_mesh, []))[1].append(user)

    # The textures of each.
    uvs = scene_uvs(geometry)
    maps: list[OcclusionMap] = []
    problems: list[str] = []
    for (path, _, _), (in_mesh, users) in sharing.items():
        user = users[0]
        objects = np.isin(np.arange(len(files)), [each.number for each in users])
        try:
            if in_mesh is None:
                maps.append(_image(user, objects, path, read, uvs, geometry))
            else:
                maps += _of_gltf(user, objects, path, read, in_mesh, geometry)
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(dict.fromkeys(problems))
    return OcclusionMaps(tuple(maps), np.array([file is not None for _, file in files], np.bool_))


def _image(
    user: User,
    objects: NDArray[np.bool_],
    path: Path,
    read: Read,
    uvs: CornerVectors,
    geometry: SceneGeometry,
) -> OcclusionMap:
    """An image over the uv of an object's mesh."""
    mesh = geometry.placed[geometry.placed_mesh[user.number]].mesh
    if mesh.uvs is None or mesh.corner_uvs is None:
        raise InputError(
            f"object {user.name}: its obscurance {path} is an image and the mesh has no uv; export it with "
            "uv, or bake values at vertices"
        )
    no_materials = np.full(_polygon_count(geometry), -1, np.int32)
    image = read(str(path.absolute()), "linear").select((0,)).clipped(0, 1)[0]
    return OcclusionMap(objects, no_materials, -1, uvs, image)


def _of_gltf(
    user: User,
    objects: NDArray[np.bool_],
    path: Path,
    read: Read,
    file: Mesh,
    geometry: SceneGeometry,
) -> list[OcclusionMap]:
    """The occlusion textures of a glTF file, on an object's polygons."""
    vertices = file_vertices(geometry, user, file)
    if vertices is None or vertices.is_other:
        raise InputError(f"{path}: its mesh is not that of {user.name}; bake it again")
    placed = geometry.placed[geometry.placed_mesh[user.number]]
    mesh = placed.mesh

    # Vertices of glTF have one material each.
    of_vertex = np.full(len(file.vertices), -1, np.int32)
    if file.polygon_materials is not None:
        of_vertex[file.corners] = np.repeat(file.polygon_materials, np.diff(file.starts))
    materials = np.full(_polygon_count(geometry), -1, np.int32)
    polygons = slice(placed.first_polygon, placed.first_polygon + mesh.polygon_count)
    materials[polygons] = of_vertex[vertices.of_corner[mesh.starts[:-1]]]

    # Their uv are those of the file.
    index = np.full(sum(len(each.mesh.corners) for each in geometry.placed), -1, np.int32)
    index[placed.first_corner : placed.first_corner + len(mesh.corners)] = vertices.of_corner
    tables = {
        name: CornerVectors(column_major(_coordinates(file, name), F), index)
        for name in {keys.get("uv") for keys in file.occlusion.values()}
    }
    maps = []
    for number in np.unique(materials[polygons]).tolist():
        keys: Mapping[str, Any] | None = (
            file.occlusion.get(file.material_names[number]) if number >= 0 else None
        )
        if keys is None:
            continue
        image = read(str(path.absolute().parent / keys["texture"]), "linear").select((0,)).clipped(0, 1)[0]
        looked_up = keys.get("filter", "bilinear"), keys.get("wrap", "repeat"), keys["strength"]
        uvs = tables[keys.get("uv")]
        maps.append(OcclusionMap(objects, materials, number, uvs, image, *looked_up))
    return maps


def _coordinates(file: Mesh, name: str | None) -> NDArray[np.float64]:
    """(V, 2) texture coordinates of a glTF file: of an attribute, by default its uv."""
    table = file.uvs if name is None else file.attributes[name]
    assert table is not None
    return np.asarray(table, np.float64)


def _polygon_count(geometry: SceneGeometry) -> int:
    return sum(each.mesh.polygon_count for each in geometry.placed)


def mapped_obscurance(
    geometry: SceneGeometry,
    baked: BakedValues,
    occlusion_maps: OcclusionMaps,
    corner_weights: CornerWeights,
) -> Floats:
    """(M,) w of files, from values at corners or textures; NaN on meshes without a file.

    A texture is 1 + strength (R - 1), as glTF has it (3.9.2), and polygons without one are open.
    """
    hits = corner_weights.hits
    w = baked_obscurance(geometry, baked, corner_weights)
    w = np.where(np.isnan(w) & occlusion_maps.has_file.take(hits.objects), F(1), w)
    polygon = geometry.polygons.take(hits.triangle)
    for each in occlusion_maps.maps:
        on_map = each.objects.take(hits.objects) & (each.materials.take(polygon) == each.material)
        at = np.flatnonzero(on_map)
        if at.size:
            uv = uv_at(geometry, each.uvs, corner_weights.take(at))
            texel = FILTERS[each.filter](each.image, uv, each.wrap)[:, 0]
            w[at] = 1 + F(each.strength) * (texel - 1)
    return w
