"""Mesh files: one module per format, its name the suffix it reads."""

from __future__ import annotations

import pkgutil
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
