"""Mesh files: one module per format, named after the suffix that it reads.

A format is a module with `read(path) -> Mesh`. If its files name other files, a module of the same name in
`_companions` has `companions(path)`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np

from illumcli.errors import InputError, LimitError
from illumcli.geometry.mesh import Mesh
from illumcli.schema.modules import modules

NO_FORMATS = frozenset(
    {"materials", "mtl", "mtl_pbr", "mtl_write", "obj_write", "occlusion", "output_mesh", "pbr", "split"}
)
"""Modules beside the formats."""
OTHER_SUFFIXES = {".glb": "gltf"}  # suffix -> module of another name
UNREAD_SUFFIXES = (".off",)  # meshes that cannot be read, listed so that they are not read as scenes


def is_mesh_file(path: Path) -> bool:
    """True if the suffix is that of a mesh file."""
    return path.suffix.lower() in (*_formats(), *UNREAD_SUFFIXES)


def read_mesh(path: Path) -> Mesh:
    """The mesh in a file; the suffix selects the format, whose module is imported on demand.

    Raises
    ------
    InputError
        An unknown suffix, a file that cannot be read, or faulty content.
    LimitError
        A file too large to be read.
    """
    formats = _formats()
    if path.suffix.lower() not in formats:
        raise InputError(
            f"{path}: no reader for '{path.suffix}' files; use one of {', '.join(sorted(formats))}"
        )
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused at the end
            mesh: Mesh = _module(formats[path.suffix.lower()]).read(path)
    except MemoryError:
        raise LimitError(f"{path}: does not fit into memory; use a smaller mesh") from None
    return mesh


def companions(path: Path) -> list[Path]:
    """The files that a mesh file may name, existing or not: material libraries with their textures, buffers.

    All files that are read are among them, possibly others, but none outside of the mesh's folder.
    """
    name = _formats().get(path.suffix.lower())
    if name not in _formats_with_companions():
        return []
    files: list[Path] = _module(f"_companions.{name}").companions(path)
    return files


def holds_obscurance(path: Path) -> bool:
    """True if the header of a mesh file announces obscurance, at vertices or in textures; False if it is
    faulty, which its reader reports."""
    name = _formats().get(path.suffix.lower())
    holds = getattr(_module(name), "holds_obscurance", None) if name else None
    try:
        return bool(holds and holds(path))
    except (InputError, OSError, ValueError, RecursionError):
        return False


@cache
def _formats() -> Mapping[str, str]:
    """Suffix -> module."""
    return {f".{name}": name for name in modules(__path__) if name not in NO_FORMATS} | OTHER_SUFFIXES


@cache
def _formats_with_companions() -> frozenset[str]:
    return frozenset(modules([f"{folder}/_companions" for folder in __path__]))


def _module(name: str) -> ModuleType:
    return import_module(f"{__name__}.{name}")


def image_within(texture: str) -> tuple[str, int] | None:
    """The mesh file and the number of the image in it, if a texture is embedded (`a.glb#images[2]`)."""
    match = re.fullmatch(r"(.*)#images\[(\d+)\]", texture, re.DOTALL)
    return (match[1], int(match[2])) if match else None


def embedded_image(path: Path, number: int) -> bytes:
    """The encoded image of this number in a mesh file.

    Raises
    ------
    InputError
        No such image.
    """
    from illumcli.mesh_files.gltf.document import open_document
    from illumcli.mesh_files.gltf.materials import image_bytes

    return image_bytes(open_document(path), number)
