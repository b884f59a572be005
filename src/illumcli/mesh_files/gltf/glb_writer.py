"""A GLB file while it is written: its JSON, and one binary chunk."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import LimitError
from illumcli.files.atomic import AtomicFile
from illumcli.files.seal import seal

VERTICES, INDICES = 34962, 34963
"""Targets of buffer views."""
LARGEST = 0xFFFFFFFF  # [bytes]
_TYPES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
_JSON, _BIN = 0x4E4F534A, 0x004E4942
_ALIGNMENT = 16
"""Of each view's data, and of what is cut out: a multiple of the size of every component type."""


class GlbWriter:
    """Adds tables and images to a document whose only buffer is the binary chunk."""

    def __init__(self, document: dict[str, Any], data: bytes = b"") -> None:
        self.json = document
        self._parts, self._size, self._given = [data], len(data), len(data)
        self._unused: list[tuple[int, int]] = []

    def view(self, data: bytes, replaced: int | None = None, **more: Any) -> int:
        """Append bytes. Returns the number of their buffer view, of the `replaced` one if it is given."""
        fill = -self._size % _ALIGNMENT
        entry = {"buffer": 0, "byteOffset": self._size + fill, "byteLength": len(data), **more}
        self._parts += [b"\0" * fill, data]
        self._size += fill + len(data)
        views = self.json.setdefault("bufferViews", [])
        if replaced is None:
            return appended(views, entry)
        self._unused.append(_extent(views[replaced]))
        views[replaced] = entry
        return replaced

    def table(self, values: NDArray[Any], target: int, **more: Any) -> int:
        """Append an array, (N,) or (N, k); the number of its accessor, whose further keys are `more`."""
        return appended(self.json.setdefault("accessors", []), self._accessor(values, target, None, more))

    def replace_table(self, accessor: int, values: NDArray[Any], target: int, **more: Any) -> None:
        """Replace an accessor, whose further keys are `more`, and the buffer view that only it refers to."""
        accessors = self.json["accessors"]
        accessors[accessor] = self._accessor(values, target, accessors[accessor]["bufferView"], more)

    def _accessor(
        self, values: NDArray[Any], target: int, replaced: int | None, more: dict[str, Any]
    ) -> dict[str, Any]:
        rows = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
        kind = "SCALAR" if rows.ndim == 1 else f"VEC{rows.shape[1]}"
        stride = {}
        if target == VERTICES and (surplus := -rows[:1].nbytes % 4):  # rows of vertices are whole words
            size = rows[:1].nbytes
            padded = np.zeros((len(rows), size + surplus), np.uint8)
            padded[:, :size] = rows.view(np.uint8).reshape(len(rows), size)
            rows, stride = padded, {"byteStride": size + surplus}
        view = self.view(rows.tobytes(), replaced, target=target, **stride)
        code = _TYPES[values.dtype.str[1:]]
        return {"bufferView": view, "componentType": code, "count": len(values), "type": kind, **more}

    def image(self, data: bytes, kind: str, name: str) -> int:
        """Append an encoded image of a media type; its number."""
        entry = {"bufferView": self.view(data), "mimeType": kind, "name": name}
        return appended(self.json.setdefault("images", []), entry)

    def write(self, path: Path) -> None:
        """Write the GLB, whole or not at all."""
        self._drop_unused()
        data = b"".join(self._parts)
        data += b"\0" * (-len(data) % 4)
        first = {"byteLength": len(data)}
        if data:
            self.json["buffers"] = [first, *self.json.get("buffers", [])[1:]]
        text = json.dumps(self.json, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        if 28 + len(text) + len(data) > LARGEST:
            raise LimitError(f"{path}: would be larger than 4 GiB, the limit of a GLB; bake to .npz or .ply")
        with AtomicFile(path) as part:
            with part.path.open("wb") as file:
                file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data)))
                file.write(struct.pack("<II", len(text), _JSON) + text)
                file.write(struct.pack("<II", len(data), _BIN) + data)
            seal(part.path)

    def _drop_unused(self) -> None:
        """Cut the data of replaced views out of the chunk that was given, unless other views share them."""
        users = [user for view in self.json.get("bufferViews", []) for user in users_of_buffer(view)]
        extents = np.array([_extent(user) for user in users if user["buffer"] == 0]).reshape(-1, 2)
        cuts: list[tuple[int, int]] = []
        for start, end in sorted(set(self._unused)):
            end -= (end - start) % _ALIGNMENT
            shared = (extents[:, 0] < end) & (extents[:, 1] > start)
            if end <= self._given and not shared.any() and (not cuts or start >= cuts[-1][1]):
                cuts.append((start, end))
        if not cuts:
            return
        data = b"".join(self._parts)
        edges = [0, *(edge for cut in cuts for edge in cut), len(data)]
        self._parts = [data[edges[k] : edges[k + 1]] for k in range(0, len(edges), 2)]
        starts = np.array([start for start, _ in cuts])
        lengths = np.cumsum([0, *(end - start for start, end in cuts)])
        for user in users:
            if user["buffer"] == 0:
                offset = user.get("byteOffset", 0)
                user["byteOffset"] = offset - int(lengths[np.searchsorted(starts, offset)])


def users_of_buffer(view: dict[str, Any]) -> list[dict[str, Any]]:
    """The entries of a buffer view that name a buffer: itself, and extensions with a compressed form."""
    named = view.get("extensions")
    others = named.values() if isinstance(named, dict) else ()
    return [view, *(each for each in others if isinstance(each, dict) and "buffer" in each)]


def _extent(view: dict[str, Any]) -> tuple[int, int]:
    start = view.get("byteOffset", 0)
    return start, start + view.get("byteLength", 0)


def appended(items: list[Any], entry: Any) -> int:
    """Append an entry. Returns its number."""
    items.append(entry)
    return len(items) - 1
