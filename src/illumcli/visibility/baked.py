"""Baked obscurance: values at the vertices of meshes, in the order of their files, and their npz."""

from __future__ import annotations

import hashlib
import json
import zipfile
from collections.abc import Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError, LimitError
from illumcli.files.atomic import AtomicFile
from illumcli.files.seal import seal_archive
from illumcli.memory import in_words, refuse_beyond
from illumcli.records import Record
from illumcli.visibility.channels import CHANNELS, Arrays

CORNER = "corner_"
"""Begins the names of arrays of corners in an npz."""


class Baked(Record):
    """Channels of V vertices, in their file's own order, and of C corners if a vertex has several values."""

    channels: Arrays  # of vertices, by the names of `CHANNELS`
    about: Mapping[str, Any] = field(default_factory=dict)
    """Parameters, seed, error, hash of the mesh, version."""
    corner_channels: Arrays = field(default_factory=dict)
    """The same channels at corners, polygon by polygon; none if each vertex has one value."""

    @property
    def obscurance(self) -> NDArray[np.float32]:
        """(V,) 1 where open."""
        return self.channels["obscurance"]

    @property
    def standard_error(self) -> NDArray[np.float32]:
        """(V,) of `obscurance`."""
        return self.channels["standard_error"]

    def of(self, name: str, count: int) -> NDArray[np.float32] | None:
        """(V,) values at the `count` vertices of a mesh; in a bake of several meshes, of the object `name`.
        None if there are none of this length."""
        return self._part(self.obscurance, "vertices", name, count)

    def of_corners(self, name: str, corners: NDArray[np.int32], count: int) -> NDArray[np.float32] | None:
        """(C,) values at the corners of a mesh: those of corners if there are any, otherwise of vertices.

        `corners` holds the vertex number of each, (C,); `count` is the number of vertices.
        """
        values, at_corners = self.of(name, count), None
        if "obscurance" in self.corner_channels:
            at_corners = self._part(self.corner_channels["obscurance"], "corners", name, len(corners))
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


def mesh_hash(vertices: NDArray[np.float64], corners: NDArray[np.int32], starts: NDArray[np.int32]) -> str:
    """Hash of a mesh's geometry, 32 hexadecimal digits; the same for any file format it was read from."""
    digest = hashlib.blake2b(digest_size=16)
    for array in (vertices, corners, starts):
        digest.update(repr((array.dtype.str, array.shape)).encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def write_npz(path: Path, baked: Baked) -> None:
    """Channels of vertices, those of corners as `corner_obscurance` and so on, and `about` as JSON text."""
    at_corners = {f"{CORNER}{name}": values for name, values in baked.corner_channels.items()}
    arrays: dict[str, Any] = {**baked.channels, **at_corners}
    with AtomicFile(path) as part:
        with part.path.open("wb") as file:
            np.savez(file, **arrays, about=np.array(json.dumps(baked.about)))
        seal_archive(part.path)


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
            at_vertices, at_corners = (
                {name: np.asarray(data[mark + name], np.float32) for name in CHANNELS if mark + name in data}
                for mark in ("", CORNER)
            )
            about = json.loads(str(data["about"])) if "about" in data else {}
            baked = Baked(at_vertices, about, at_corners)
            if not at_vertices:
                raise ValueError("no values of vertices")
    except LimitError:
        raise
    except Exception as why:  # zipfile, numpy and json each have their own exceptions
        raise InputError(f"{path}: is no baked obscurance ({why}); bake it with illum ao-bake") from why
    w = [each["obscurance"] for each in (at_vertices, at_corners) if "obscurance" in each]
    sound = all(each.ndim == 1 and ((each >= 0) & (each <= 1)).all() for each in w)
    if not sound or len({len(values) for values in at_vertices.values()}) > 1:
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
