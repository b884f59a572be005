"""Primitives of a glTF document with other vertices: copies of their own."""

from __future__ import annotations

from collections.abc import Container
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.mesh_files.gltf.accessors import stored
from illumcli.mesh_files.gltf.document import Document, printable
from illumcli.mesh_files.gltf.glb_writer import INDICES, VERTICES, GlbWriter
from illumcli.mesh_files.split import SplitVertices

_ANY = (1, 2, 3, 4)
_KEPT = ("normalized", "name", "extras", "extensions")
"""Keys of an accessor that copies of its rows have, too."""


def reindex(
    document: Document,
    writer: GlbWriter,
    primitive: dict[str, Any],
    split: SplitVertices,
    owned: Container[int],
) -> list[str]:
    """Split the vertices of a primitive. Returns the attributes that cannot be read and are left out.

    Parameters
    ----------
    primitive : dict
        Modified: its attributes, morph targets, indices and mode.
    owned
        Accessors that only this primitive has; they are replaced.
    """

    def put(number: int | None, rows: NDArray[Any], target: int, **more: Any) -> int:
        if number is None or number not in owned:
            return writer.table(rows, target, **more)
        writer.replace_table(number, rows, target, **more)
        return number

    left_out: list[str] = []
    for tables in (primitive["attributes"], *primitive.get("targets", [])):
        for name, number in list(tables.items()):
            try:
                rows = stored(document, number, _ANY)[split.source]
            except (InputError, IndexError):
                del tables[name]
                left_out.append(f"attribute {printable(name)}, which cannot be read")
                continue
            entry = document.item("accessors", number)
            more = {key: entry[key] for key in _KEPT if key in entry}
            if name == "POSITION":
                more |= {"min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist()}
            rows = rows[:, 0] if rows.shape[1] == 1 else rows
            tables[name] = put(number, rows, VERTICES, **more)
    corners = fitting(split.of_corner, len(split.source))
    primitive["indices"] = put(primitive.get("indices"), corners, INDICES)
    primitive.pop("mode", None)
    return left_out


def fitting(indices: NDArray[Any], count: int) -> NDArray[Any]:
    """Indices into `count` vertices in a type whose largest value, which is reserved, is not in use."""
    return indices.astype(np.uint16 if count < 65536 else np.uint32)
