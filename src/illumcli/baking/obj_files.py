"""What an OBJ needs beside its lines: meshes in their places, material libraries, images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import OutputError
from illumcli.files.atomic import AtomicFile
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.scene_geometry import PlacedMesh
from illumcli.geometry.transforms import cofactors
from illumcli.images.encoded import encoded_image
from illumcli.mesh_files import mtl, obj
from illumcli.mesh_files._files import content
from illumcli.mesh_files._polygons import runs
from illumcli.mesh_files.mtl_write import mtl_lines
from illumcli.shading.materials import textures_at

_ENDINGS = {"image/png": ".png", "image/jpeg": ".jpg"}


def copy_materials(path: Path, source: Path, force: bool) -> None:
    """Copy the material libraries of an OBJ, and their images, beside `path`; `force` replaces other files.

    Raises
    ------
    OutputError
        A different file is there, and `force` is False; a file cannot be written.
    """
    libraries = obj.libraries(source)
    images = [image for library in libraries for image in mtl.images(library, source.parent)]
    folder = source.parent.resolve()
    for file in (*libraries, *images):  # all of them in the folder or below it, links followed
        _put(path.parent / file.resolve().relative_to(folder), content(file), force)


def write_materials(path: Path, meshes: Sequence[Mesh], force: bool) -> str | None:
    """Write the materials of meshes as a library beside `path`, with their images. Returns its name, or None
    if there are no materials; errors as of `copy_materials`."""
    materials = selected_materials(meshes)
    if not materials:
        return None
    names: dict[str, str] = {}

    def image(texture: str) -> str:
        if texture not in names:
            data, kind = encoded_image(texture)
            names[texture] = f"{path.stem}.{len(names)}{_ENDINGS[kind]}"
            _put(path.with_name(names[texture]), data, force)
        return names[texture]

    text = "".join(f"{line}\n" for line in mtl_lines(materials, image))
    library = path.with_suffix(".mtl")
    _put(library, text.encode(), force)
    return library.name


def selected_materials(meshes: Sequence[Mesh]) -> dict[str, Mapping[str, Any]]:
    """The keys of the materials that meshes select, by name; none for a name that no library has."""
    return {name: mesh.materials.get(name, {}) for mesh in meshes for name in mesh.material_names}


def _put(target: Path, data: bytes, force: bool) -> None:
    """Write a file, unless it is there already with these bytes."""
    if target.is_file():
        if target.read_bytes() == data:
            return
        if not force:
            raise OutputError(f"{target}: a different file is there; use --force to replace it")
    with AtomicFile(target) as part:
        part.path.write_bytes(data)


def with_textures_in(folder: Path, mesh: Mesh) -> Mesh:
    """A mesh with whole paths of its textures, which are relative to `folder`, that of its file."""
    materials = {
        name: textures_at(keys, lambda path: str(folder / path)) for name, keys in mesh.materials.items()
    }
    return replace(mesh, materials=materials)


def placed_mesh(placed: PlacedMesh) -> Mesh:
    """A mesh with the vertices and normals that it has in the scene; mirrored polygons are reversed."""
    mesh, linear = placed.mesh, placed.matrix[:3, :3]
    side = -1 if placed.mirrored else 1
    moved = replace(
        mesh,
        vertices=mesh.vertices @ linear.T + placed.matrix[:3, 3],
        normals=None if mesh.normals is None else mesh.normals @ cofactors(linear).T * side,
    )
    if not placed.mirrored:
        return moved
    order = reversed_corners(mesh)
    return replace(
        moved,
        corners=mesh.corners[order],
        corner_normals=None if mesh.corner_normals is None else mesh.corner_normals[order],
        corner_uvs=None if mesh.corner_uvs is None else mesh.corner_uvs[order],
    )


def reversed_corners(mesh: Mesh) -> NDArray[np.int64]:
    """(C,) the corners of each polygon in reverse order."""
    return runs(mesh.starts[1:] - 1, np.diff(mesh.starts), step=-1)
