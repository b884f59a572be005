"""Mesh files: one module per format, its name the suffix it reads."""

from __future__ import annotations

import pkgutil
import re
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import numpy as np

from illumcli.errors import InputError, LimitError
from illumcli.geometry.mesh import Mesh

OTHER_SUFFIXES = {".glb": "gltf"}  # read by the module of another name


def read_mesh(path: Path) -> Mesh:
    """The mesh in the file `path`; the reader is picked by suffix and imported only now.

    Raises
    ------
    InputError
        An unknown suffix, a file that cannot be read, or one whose content is wrong.
    LimitError
        A file too large to be read.
    """
    readers = _readers()
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(
            f"{path}: no reader for '{path.suffix}' files; use one of {', '.join(sorted(readers))}"
        )
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused at the end
            mesh: Mesh = import_module(f"{__name__}.{reader}").read(path)
    except MemoryError:
        raise LimitError(f"{path}: does not fit into memory; use a smaller mesh") from None
    return mesh


def _readers() -> dict[str, str]:
    """Suffix -> module."""
    names = [module.name for module in pkgutil.iter_modules(__path__) if not module.name.startswith("_")]
    return {f".{name}": name for name in names} | OTHER_SUFFIXES


def companions(path: Path) -> list[Path]:
    """The files that a mesh file may name, whether they are there or not: material libraries with their
    textures, buffers; more of them than are read, never fewer."""
    suffix = path.suffix.lower()
    if suffix == ".obj":
        libraries = _named(path, rb"^\s*mtllib[ \t]+(.*)")
        images = [
            each
            for library in libraries
            if library.is_file()
            for each in _named(library, rb"^\s*map_.*?[ \t](.*)")
        ]
        return [*libraries, *images]
    if suffix in (".gltf", ".glb"):
        return _named(path, rb'"uri"\s*:\s*"([^"]{1,4096})"')
    return []


def _named(path: Path, pattern: bytes) -> list[Path]:
    """The paths that the text of `path` gives, each whole and word by word; none outside its folder, which no
    reader follows."""
    from urllib.parse import unquote

    from illumcli.geometry.readers._files import beside, content

    try:
        data = content(path)
    except InputError:  # whoever reads the file says what is wrong with it
        return []
    word = b"mtllib" if b"mtllib" in pattern else b"map_" if b"map_" in pattern else b'"uri"'
    if word not in data:
        return []
    found: dict[Path, None] = {}
    for match in re.finditer(pattern, data, re.MULTILINE):
        said = match[1].decode("utf-8", "surrogateescape").strip()
        if "\0" in said or said.startswith("data:"):
            continue
        for name in (said, *said.split()):
            with suppress(InputError):
                found[beside(path, unquote(name), str(path))] = None
    return list(found)
