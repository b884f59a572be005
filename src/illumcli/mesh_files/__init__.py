"""Mesh files: one module per format, its name the suffix it reads.

A format is a module with `read(path) -> Mesh`, and `companions(path)` where its files name others.
"""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np

from illumcli.errors import InputError, LimitError
from illumcli.geometry.mesh import Mesh
from illumcli.schema.modules import modules

NO_FORMATS = frozenset({"mtl", "output_mesh"})
"""Modules beside the formats."""
OTHER_SUFFIXES = {".glb": "gltf"}  # read by the module of another name
UNREAD_SUFFIXES = (".off",)  # known to be meshes, so that they are not taken for scenes


def is_mesh_file(path: Path) -> bool:
    """Does the suffix say that the file is a mesh?"""
    return path.suffix.lower() in (*_formats(), *UNREAD_SUFFIXES)


def read_mesh(path: Path) -> Mesh:
    """The mesh in the file `path`; the format is picked by suffix and its module imported only now.

    Raises
    ------
    InputError
        An unknown suffix, a file that cannot be read, or one whose content is wrong.
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
    """The files that a mesh file may name, whether they are there or not: material libraries with their
    textures, buffers; more of them than are read, never fewer, and none outside the folder of the mesh."""
    name = _formats().get(path.suffix.lower())
    named = getattr(_module(name), "companions", None) if name else None
    files: list[Path] = named(path) if named else []
    return files


def _formats() -> dict[str, str]:
    """Suffix -> module."""
    return {f".{name}": name for name in modules(__path__) if name not in NO_FORMATS} | OTHER_SUFFIXES


def _module(name: str) -> ModuleType:
    return import_module(f"{__name__}.{name}")


def image_within(texture: str) -> tuple[str, int] | None:
    """The mesh file and the number of the image in it, where that is what a mesh's own library names as a
    texture (`a.glb#images[2]`)."""
    match = re.fullmatch(r"(.*)#images\[(\d+)\]", texture, re.DOTALL)
    return (match[1], int(match[2])) if match else None


def embedded_image(path: Path, number: int) -> bytes:
    """An image as the mesh file `path` holds it, encoded.

    Raises
    ------
    InputError
        An image that is not there.
    """
    from illumcli.mesh_files.gltf.document import open_document
    from illumcli.mesh_files.gltf.materials import image_bytes

    return image_bytes(open_document(path), number)
