"""A glTF document: the JSON of a .gltf or .glb file, its buffers, and checked access to both.

The JSON is used as it is: a typed object model of it costs 0.16 s of import time and checks nothing.
"""

from __future__ import annotations

import json
import re
from base64 import b64decode
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.geometry.repairs import Repair, note
from illumcli.mesh_files._files import TAKEN, beside, content, nearby
from illumcli.records import Value

READ = frozenset(
    {
        "EXT_mesh_gpu_instancing",
        "KHR_materials_emissive_strength",
        "KHR_materials_ior",
        "KHR_materials_pbrSpecularGlossiness",
        "KHR_materials_unlit",
        "KHR_mesh_quantization",
        "KHR_node_visibility",
        "KHR_texture_transform",
    }
)
"""Extensions that are read, as docs/gltf.md says."""


@dataclass(slots=True)
class Document:
    """The JSON of a file and its buffers, with checked access."""

    path: Path
    json: dict[str, Any]
    chunk: bytes | None
    """The binary chunk of a .glb file."""
    cut: bool = False
    """The .glb file is shorter than it says."""
    buffers: dict[int, bytes] = field(default_factory=dict)
    repairs: dict[str, Repair] = field(default_factory=dict)

    def count(self, what: str, where: str = "", count: int = 1) -> None:
        """Note that something was repaired or left out, at the part `where` of the JSON."""
        note(self.repairs, what, f": {where}" if where else "", count)

    def wrong(self, fact: str, advice: str = "export the mesh again") -> InputError:
        """The error for a file that cannot be read, with advice."""
        return InputError(f"{self.path}: {fact}; {advice}")

    def reason(self, error: InputError) -> str:
        """The fact of an error from `wrong`, without the file and the advice."""
        return str(error).removeprefix(f"{self.path}: ").rpartition("; ")[0]

    def items(self, kind: str) -> list[Any]:
        """A top-level list; empty if the file has none."""
        items = self.json.get(kind, [])
        if not isinstance(items, list):
            raise self.wrong(f"its {kind} are no list")
        return items

    def item(self, kind: str, index: Any) -> dict[str, Any]:
        """Entry `index` of a top-level list."""
        items = self.items(kind)
        if not is_index(index) or index >= len(items):
            raise self.wrong(f"refers to {kind}[{index!r:.20}], which is not there")
        if not isinstance(items[index], dict):
            raise self.wrong(f"{kind}[{index}] is no object")
        entry: dict[str, Any] = items[index]
        return entry

    def integer(self, entry: dict[str, Any], key: str, where: str, default: int | None = None) -> int:
        """A whole number from 0."""
        value = entry.get(key, default)
        if not isinstance(value, int) or not is_index(value) or value > 1 << 53:
            raise self.wrong(f"{where}.{key} must be a whole number from 0, is {value!r:.20}")
        return value

    def numbers(
        self, entry: dict[str, Any], key: str, where: str, default: tuple[float, ...]
    ) -> NDArray[np.float64]:
        """As many finite numbers as `default` has, in an array."""
        values = entry.get(key, default)
        good = isinstance(values, list | tuple) and len(values) == len(default)
        if not good or not all(is_finite(value) for value in values):
            raise self.wrong(f"{where}.{key} must be {len(default)} finite numbers")
        return np.array(values, np.float64)

    def view(self, index: Any) -> tuple[bytes, int, int]:
        """The buffer of a view, and the offsets of the view's start and end in it."""
        where = f"bufferViews[{index!r:.20}]"
        entry = self.item("bufferViews", index)
        number = entry.get("buffer")
        if compressed := ", ".join(
            printable(name) for name, extension in extensions(entry).items() if "buffer" in extension
        ):
            buffer = self.item("buffers", number)
            if "uri" not in buffer and (number != 0 or self.chunk is None):
                raise self.wrong(
                    f"{where} has its data in the extension {compressed:.80} alone, which is not read",
                    "export the mesh without compression",
                )
        data = self.buffer(number)
        start = self.integer(entry, "byteOffset", where, 0)
        end = start + self.integer(entry, "byteLength", where)
        if end > len(data):
            fact = f"{where} ends at byte {end} of its buffer, which has {len(data)}"
            raise self.wrong(f"the file is cut off, {fact}" if self.cut else fact)
        return data, start, end

    def buffer(self, index: Any) -> bytes:
        """The content of a buffer, cut to its declared length."""
        if is_index(index) and index in self.buffers:
            return self.buffers[index]
        entry, where = self.item("buffers", index), f"buffers[{index}]"
        length = self.integer(entry, "byteLength", where)
        uri = entry.get("uri")
        if uri is not None:
            data = self.resource(uri, f"{where}.uri")
        elif index == 0 and self.chunk is not None:
            data = self.chunk
        else:
            raise self.wrong(f"{where} has no uri and the file no binary chunk for it")
        if len(data) < length:
            self.count("buffers shorter than announced", where)
        self.buffers[index] = data[:length]
        return self.buffers[index]

    def resource(self, uri: Any, where: str) -> bytes:
        """The content of a URI: inline data, or a file in the folder of the mesh."""
        if not isinstance(uri, str):
            raise self.wrong(f"{where} is no text")
        if is_inline(uri):
            return self._inline(uri, where)
        if "://" in uri:
            raise self.wrong(f"{where} is on the network", "copy the file beside the mesh and name it alone")
        file, fault = self.nearby(uri)
        if file is None:
            return content(beside(self.path, unquote(uri), str(self.path)))
        if fault:
            self.count(f"buffers {fault} {TAKEN}", where)
        return content(file)

    def nearby(self, uri: str) -> tuple[Path | None, str]:
        """The file that a URI names, and its fault, as from `_files.nearby`.

        The URI is percent-decoded as specified; if that gives no file, it is used as it is.
        """
        file, fault = nearby(self.path, unquote(uri), self.path.parent)
        if file is None or fault:
            plain, plain_fault = nearby(self.path, uri, self.path.parent)
            if plain is not None and (file is None or not plain_fault):
                return plain, plain_fault
        return file, fault

    def _inline(self, uri: str, where: str) -> bytes:
        """The bytes of a data URI of any media type; blanks and missing padding are allowed."""
        head, _, body = uri.partition(",")
        data = unquote_to_bytes(body.encode("utf-8", "replace"))
        if not head.lower().endswith(";base64"):
            return data
        data = re.sub(rb"[\s=]", b"", data)
        try:
            return b64decode(data + b"=" * (-len(data) % 4), altchars=_altchars(data), validate=True)
        except ValueError:
            raise self.wrong(f"{where} is no readable data URI") from None


def _altchars(data: bytes) -> bytes | None:
    """The last two letters of the URL-safe base64 alphabet if `data` contains one of them."""
    return b"-_" if b"-" in data or b"_" in data else None


def open_document(path: Path) -> Document:
    """The document in a .gltf or .glb file, checked to be glTF 2."""
    # The JSON.
    data = content(path)
    chunks = _chunks(path, data) if data.startswith(b"glTF") else _Chunks(data, None, False, 0)
    data = chunks.json
    try:
        text = data.decode(json.detect_encoding(data), "replace")
        parsed = json.loads(text.rstrip("\0 \t\r\n"))
    except (ValueError, RecursionError) as error:
        place = f"{path}:{error.lineno}" if isinstance(error, json.JSONDecodeError) else f"{path}"
        raise InputError(f"{place}: is no JSON ({error!s:.80}); export the mesh again") from None
    if not isinstance(parsed, dict) or not isinstance(parsed.get("asset"), dict):
        raise InputError(
            f"{path}: is no glTF file, it has no 'asset'; give the file the suffix of its format"
        )
    version = parsed["asset"].get("version")
    if not str(version).startswith("2"):
        raise InputError(f"{path}: is glTF of version {version!r:.20}; export it as glTF 2")

    # The document; a wrong length is noted.
    document = Document(path, parsed, chunks.binary, cut=chunks.cut)
    if chunks.surplus > 0:
        document.count("bytes behind the announced end", "", chunks.surplus)
    elif chunks.surplus:
        document.count("files longer than announced")
    if chunks.cut:
        document.count("files shorter than announced")
    _name_extensions(document)
    return document


def read_json(path: Path) -> dict[str, Any]:
    """The JSON of a .gltf or .glb file, without its other chunks.

    Raises
    ------
    OSError, ValueError, RecursionError
        A file that cannot be read, or no JSON object.
    """
    with path.open("rb") as file:
        start = file.read(20)
        is_binary = start.startswith(b"glTF")
        data = file.read(int.from_bytes(start[12:16], "little")) if is_binary else start + file.read()
    parsed = json.loads(data.decode(json.detect_encoding(data), "replace").rstrip("\0 \t\r\n"))
    if not isinstance(parsed, dict):
        raise ValueError("no JSON object")
    return parsed


def _name_extensions(document: Document) -> None:
    """Note the required extensions that are not read.

    The core of the file is read nevertheless. Geometry that only an extension has is refused when it is read.
    """
    needed = document.json.get("extensionsRequired", [])
    for name in needed if isinstance(needed, list) else [needed]:
        if not isinstance(name, str) or name not in READ:
            document.count(f"required extension {printable(name)}, read in its core state")


class _Chunks(Value):
    """The chunks of a .glb file."""

    json: bytes
    binary: bytes | None
    cut: bool
    """The last chunk is longer than the file."""
    surplus: int
    """Bytes after the declared end and all chunks; negative if chunks continue after the declared end."""


def _chunks(path: Path, data: bytes) -> _Chunks:
    """The first JSON chunk and the first binary chunk of a .glb file, in any order, among others.

    A wrong declared length is tolerated if both chunks are complete: the search for them continues after it.
    """
    version, length = int.from_bytes(data[4:8], "little"), int.from_bytes(data[8:12], "little")
    if version != 2:
        raise InputError(f"{path}: is binary glTF of version {version}; export it as glTF 2")
    chunks: dict[bytes, bytes] = {}
    at, cut = 12, False
    while at + 8 <= len(data):
        size, kind = int.from_bytes(data[at : at + 4], "little"), data[at + 4 : at + 8]
        wanted = kind in (b"JSON", b"BIN\0") and kind not in chunks
        if at >= length and not wanted:
            break
        cut = at + 8 + size > len(data)
        chunks.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if b"JSON" not in chunks:
        raise InputError(f"{path}: has no JSON chunk; export the mesh again")
    cut = cut or length > len(data)
    surplus = 0 if cut else length - at if at > length else len(data) - length
    return _Chunks(chunks[b"JSON"], chunks.get(b"BIN\0"), cut, surplus)


def extensions(entry: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The extensions of a part of the JSON, by name."""
    named = entry.get("extensions")
    mapping = named if isinstance(named, dict) else {}
    return {name: each if isinstance(each, dict) else {} for name, each in mapping.items()}


def extension(entry: dict[str, Any], name: str) -> dict[str, Any]:
    """One extension of a part of the JSON; empty if it has none of that name."""
    return extensions(entry).get(name, {})


def values_of(value: Any, key: str) -> Iterator[Any]:
    """The values of a key anywhere in a part of the JSON."""
    if isinstance(value, dict):
        if key in value:
            yield value[key]
        for each in value.values():
            yield from values_of(each, key)
    elif isinstance(value, list):
        for each in value:
            yield from values_of(each, key)


def printable(name: Any) -> str:
    """A name for messages: up to 60 printable letters, without terminal control characters."""
    return "".join(letter if letter.isprintable() else "?" for letter in f"{name!s:.60}")


def dicts(value: Any) -> list[dict[str, Any]]:
    """The objects in a list of the JSON; none if it is no list."""
    return [each for each in value if isinstance(each, dict)] if isinstance(value, list) else []


def is_inline(uri: str) -> bool:
    """True if a URI contains its data."""
    return uri[:5].lower() == "data:"


def is_index(value: Any) -> bool:
    """True for whole numbers from 0."""
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def is_finite(value: Any) -> bool:
    """True for numbers whose products with each other are finite."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= 1e18
