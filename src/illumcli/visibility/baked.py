"""Baked obscurance: values at the vertices of meshes, in the order of their files, and their npz."""

from __future__ import annotations

import hashlib
import json
import os
import struct
import zipfile
from collections.abc import Mapping
from dataclasses import field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError, LimitError
from illumcli.files.atomic import AtomicFile
from illumcli.files.seal import BLANK, seal
from illumcli.memory import in_words, refuse_beyond
from illumcli.records import Record


class Baked(Record):
    """Obscurance of V vertices, in their file's own order, and of C corners where a vertex has several."""

    obscurance: NDArray[np.float32]  # (V,) 1 where open
    standard_error: NDArray[np.float32]  # (V,)
    bent_normal: NDArray[np.float32] | None = None  # (V, 3) unit; 0 where nothing is open
    about: Mapping[str, Any] = field(default_factory=dict)
    """Parameters, seed, error, hash of the mesh, version."""
    corner_obscurance: NDArray[np.float32] | None = None  # (C,) polygon by polygon
    corner_standard_error: NDArray[np.float32] | None = None  # (C,)
    corner_bent_normal: NDArray[np.float32] | None = None  # (C, 3)

    def of(self, name: str, count: int) -> NDArray[np.float32] | None:
        """(V,) values at the `count` vertices of a mesh; in a bake of several meshes, of the object `name`.
        None if there are none of this length."""
        return self._part(self.obscurance, "vertices", name, count)

    def of_corners(self, name: str, corners: NDArray[np.int32], count: int) -> NDArray[np.float32] | None:
        """(C,) values at the corners of a mesh: those of corners if there are any, otherwise of vertices.

        `corners` holds the vertex number of each, (C,); `count` is the number of vertices.
        """
        values, at_corners = self.of(name, count), None
        if self.corner_obscurance is not None:
            at_corners = self._part(self.corner_obscurance, "corners", name, len(corners))
        return values[corners] if at_corners is None and values is not None else at_corners

    def _part(
        self, values: NDArray[np.float32], what: str, name: str, count: int
    ) -> NDArray[np.float32] | None:
        if len(values) == count:
            return values
        first = 0
        for object_name, size in dict(self.about.get(what, {})).items():
            if object_name == name and size == count:
                return values[first : first + count]
            first += size
        return None

    def hashes(self) -> list[str]:
        """Hashes of the meshes that were baked."""
        return list(dict(self.about.get("meshes", {})).values())

    def columns(self) -> dict[str, NDArray[np.float32]]:
        """The arrays of values per vertex, by name."""
        columns = {"obscurance": self.obscurance, "standard_error": self.standard_error}
        return columns if self.bent_normal is None else {**columns, "bent_normal": self.bent_normal}

    def corner_columns(self) -> dict[str, NDArray[np.float32]]:
        """The arrays of values per corner, by name; none if no vertex has several values."""
        names = ("corner_obscurance", "corner_standard_error", "corner_bent_normal")
        return {name: values for name in names if (values := getattr(self, name)) is not None}


def mesh_hash(vertices: NDArray[np.float64], corners: NDArray[np.int32], starts: NDArray[np.int32]) -> str:
    """Hash of a mesh's geometry, 32 hexadecimal digits; the same for any file format it was read from."""
    digest = hashlib.blake2b(digest_size=16)
    for array in (vertices, corners, starts):
        digest.update(repr((array.dtype.str, array.shape)).encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def write_npz(path: Path, baked: Baked) -> None:
    """The arrays of `Baked.columns` and `Baked.corner_columns`, and `about`, JSON as text."""
    arrays: dict[str, Any] = {**baked.columns(), **baked.corner_columns()}
    with AtomicFile(path) as part:
        with part.path.open("wb") as file:
            np.savez(file, **arrays, about=np.array(json.dumps(baked.about)))
            # The archive ends in the length of its comment: append an empty seal as the comment.
            file.seek(-2, os.SEEK_END)
            file.write(struct.pack("<H", len(BLANK)) + BLANK.encode())
        seal(part.path)


def refuse_unpacked(path: Path) -> None:
    """Raise LimitError if an archive's content, which may be far larger than its file, exceeds the memory."""
    with zipfile.ZipFile(path) as archive:
        length = sum(each.file_size for each in archive.infolist())
    refuse_beyond(3 * length, f"{path}: {in_words(length)} unpacked", "bake a smaller mesh")


def read_npz(path: Path) -> Baked:
    """What `write_npz` wrote.

    Raises
    ------
    InputError
        Another kind of file, or a damaged one.
    """
    try:
        refuse_unpacked(path)
        with np.load(path, allow_pickle=False) as data:
            names = [part.name for part in fields(Baked) if part.name != "about" and part.name in data]
            arrays = {name: np.asarray(data[name], np.float32) for name in names}
            about = json.loads(str(data["about"])) if "about" in data else {}
            baked = Baked(**arrays, about=about)
    except LimitError:
        raise
    except Exception as why:  # zipfile, numpy and json each have their own exceptions
        raise InputError(f"{path}: is no baked obscurance ({why}); bake it with illum ao-bake") from why
    values = [baked.obscurance, *(() if baked.corner_obscurance is None else (baked.corner_obscurance,))]
    sound = all(w.ndim == 1 and np.isfinite(w).all() and (w >= 0).all() and (w <= 1).all() for w in values)
    if not sound or baked.standard_error.shape != baked.obscurance.shape:
        raise InputError(f"{path}: obscurance must be one number from 0 to 1 per vertex; bake it again")
    return baked


def read_about(path: Path) -> dict[str, Any]:
    """`Baked.about` of an npz.

    Raises
    ------
    Exception
        Not such a file; zipfile, numpy and json each have their own exceptions.
    """
    refuse_unpacked(path)
    with np.load(path, allow_pickle=False) as data:
        return dict(json.loads(str(data["about"])))
