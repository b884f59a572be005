"""Files of baked obscurance: npz, PLY and GLB."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.geometry.mesh import Mesh
from illumcli.images.contents import image_contents, image_texts
from illumcli.images.encoded import encoded_image
from illumcli.mesh_files import obj_write, ply
from illumcli.mesh_files.color_change import COLOR_CHANGES
from illumcli.mesh_files.gltf import write as gltf
from illumcli.mesh_files.gltf.extend import extend_glb
from illumcli.mesh_files.obj_write import NamedMesh
from illumcli.mesh_files.occlusion import NO_MAPS, OcclusionMaps
from illumcli.mesh_files.output_mesh import OutputMesh, VertexData
from illumcli.mesh_files.split import SplitVertices
from illumcli.visibility import baked as npz
from illumcli.visibility.baked import Baked
from illumcli.visibility.channels import ply_columns

ASSETS = (".ply", ".glb", ".obj")
"""Files that have everything of the input that their format can hold."""
SUFFIXES = (".npz", *ASSETS)


def write_baked_ply(
    path: Path,
    meshes: Sequence[OutputMesh],
    baked: Baked,
    source: Path | None,
    color: str | None,
    split: SplitVertices | None = None,
) -> None:
    """Write a PLY with a float property for each name in `Channel.ply`; `quality`, which MeshLab shows, is
    obscurance.

    Parameters
    ----------
    source
        A PLY whose content is kept and extended; None to write `meshes`.
    color : str, optional
        What obscurance does to the colours of vertices, by the names of `COLOR_CHANGES`.
    split : SplitVertices, optional
        Of the vertices of `source`; `baked` has a value for each of them.
    """
    ply.write(path, meshes, _vertex_data(ply_columns(baked.channels), baked, color), source, split)


def write_baked_glb(
    path: Path,
    meshes: Sequence[OutputMesh],
    baked: Baked,
    color: str | None,
    occlusion: OcclusionMaps = NO_MAPS,
) -> None:
    """Write a GLB with an attribute for each channel: `_OBSCURANCE` and so on; `COLOR_0` only if a `color`
    is given, or the meshes have colours."""
    data = _vertex_data(baked.channels, baked, color)
    gltf.write_glb(path, meshes, data, encoded_image, occlusion)


def add_baked_to_glb(
    path: Path, source: Path, baked: Baked, color: str | None, occlusion: OcclusionMaps = NO_MAPS
) -> list[str]:
    """Write a GLB with all that a glTF file has and the attributes of `write_baked_glb`.

    Returns the parts of the source that it does not have.
    """
    return extend_glb(path, source, _vertex_data(baked.channels, baked, color), occlusion)


def extend_baked_obj(path: Path, source: Path, mesh: Mesh, baked: Baked, color: str | None) -> None:
    """Write the lines of an OBJ with obscurance as grey of vertices, or their colours with its change."""
    obj_write.extend_obj(path, source, mesh, _vertex_data(baked.channels, baked, color))


def write_baked_obj(
    path: Path, meshes: Sequence[NamedMesh], baked: Baked, color: str | None, library: str | None
) -> None:
    """Write meshes as an OBJ with the colours of `extend_baked_obj`; `library` is its material library."""
    obj_write.write_obj(path, meshes, _vertex_data(baked.channels, baked, color), library)


def baked_contents(path: Path) -> list[str]:
    """The content hash in a file written here.

    Raises
    ------
    InputError
        A file that illum did not write.
    """
    if path.suffix.lower() in (".png", ".exr"):
        return image_contents(path)
    try:
        content = baked_about(path)["content"]
    except Exception as why:  # zipfile, numpy and json each have their own
        raise InputError(f"{path}: is no baked obscurance ({why}); bake it with illum ao-bake") from why
    if not isinstance(content, str):
        raise InputError(f"{path}: names no content; bake it with illum ao-bake")
    return [content]


def baked_about(path: Path) -> dict[str, Any]:
    """The description of its bake in a file written here.

    Raises
    ------
    Exception
        Not such a file; zipfile, numpy and json each have their own exceptions.
    """
    if path.suffix.lower() in (".png", ".exr"):
        return dict(json.loads(image_texts(path)["illum:about"]))
    readers = {
        ".npz": npz.read_about,
        ".glb": gltf.read_about,
        ".ply": ply.read_about,
        ".obj": obj_write.read_about,
    }
    return readers[path.suffix.lower()](path)


def _vertex_data(columns: Mapping[str, NDArray[np.float32]], baked: Baked, color: str | None) -> VertexData:
    change = None if color is None else COLOR_CHANGES[color]
    return VertexData(columns, baked.about, change, baked.corner_channels)
