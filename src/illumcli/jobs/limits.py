"""What a run would take, against what the machine has, before anything is allocated."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from illumcli.errors import LimitError
from illumcli.memory import free_memory

MEMORY_SHARE = 0.8
"""Of the memory that is free."""
MESH_FACTOR = 6
"""Bytes in memory per byte of a mesh file: binary formats take 3 to 5 while they are read, text less."""
DENSEST = 20
"""No picture worth rendering packs better than this."""


def refuse_memory(rows: int, width: int, values: int, files: Iterable[Path], place: str) -> None:
    """Raise LimitError where a band of `rows` and the meshes do not fit into the memory that is free.

    Parameters
    ----------
    rows, width : int
        Of the band that is held at once [pixels].
    values : int
        Numbers per pixel.
    files : iterable of Path
        Meshes; those that are not there count for nothing here.
    """
    free = free_memory()
    if free is None:
        return
    meshes = sum(path.stat().st_size for path in files if path.is_file())
    need = 2 * 4 * rows * width * values + MESH_FACTOR * meshes
    if need > MEMORY_SHARE * free:
        raise LimitError(
            f"{place}: takes about {_size(need)} of memory, {_size(MEMORY_SHARE * free)} may be used; "
            "ask for fewer layers, a smaller film or a smaller mesh"
        )


def refuse_disk(path: Path, pixel_bytes: int) -> None:
    """Raise LimitError where an image of so many bytes, well packed, does not fit beside `path`."""
    folder = path.absolute().parent
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    try:
        disk = os.statvfs(folder)
        free = disk.f_bavail * disk.f_frsize
    except OSError:
        return
    if pixel_bytes > DENSEST * free:
        raise LimitError(
            f"{path}: holds {_size(pixel_bytes)} of pixels, {_size(free)} are free on the disk; "
            "free some space, choose another folder or a smaller film"
        )


def _size(count: float) -> str:
    for unit in ("bytes", "KiB", "MiB", "GiB"):
        if count < 1024:
            return f"{count:.3g} {unit}"
        count /= 1024
    return f"{count:.3g} TiB"
