"""A glTF document with all of its buffers in one binary chunk, and its images, too."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

from illumcli.errors import InputError
from illumcli.mesh_files.gltf.document import Document, printable
from illumcli.mesh_files.gltf.glb_writer import GlbWriter, users_of_buffer

_ALIGNMENT = 16
_SIGNATURES = {
    b"\x89PNG": "image/png",
    b"\xff\xd8\xff": "image/jpeg",
    b"\xabKTX 20": "image/ktx2",
    b"RIFF": "image/webp",
}


def embedded(document: Document, left_out: list[str]) -> tuple[Document, GlbWriter]:
    """A copy of a document with one binary chunk, and the writer that adds to it.

    Buffers and images that cannot be read stay outside; a line for each is appended to `left_out`.
    """
    out = deepcopy(document.json)
    chunk, places, outside = _chunk(document, left_out)
    for view in out.get("bufferViews", []):
        for user in users_of_buffer(view):
            if user.get("buffer") in places:
                user["buffer"], base = places[user["buffer"]]
                user["byteOffset"] = user.get("byteOffset", 0) + base
    if chunk or outside:
        out["buffers"] = [{"byteLength": len(chunk)}, *outside]
    writer = GlbWriter(out, chunk)
    _embed_images(document, writer, left_out)
    return Document(document.path, out, chunk), writer


def media_type(data: bytes) -> str | None:
    """The media type of an encoded image that glTF or one of its extensions allows."""
    return next((kind for start, kind in _SIGNATURES.items() if data.startswith(start)), None)


def _chunk(
    document: Document, left_out: list[str]
) -> tuple[bytes, dict[int, tuple[int, int]], list[dict[str, Any]]]:
    """All buffers one after the other, their new numbers and offsets, and those that cannot be read."""
    parts: list[bytes] = []
    places: dict[int, tuple[int, int]] = {}
    outside: list[dict[str, Any]] = []
    size = 0
    for number, entry in enumerate(document.items("buffers")):
        try:
            data = document.buffer(number)
        except InputError:
            places[number] = 1 + len(outside), 0
            outside.append(entry)
            if "uri" in entry:
                left_out.append(f"buffers[{number}], {printable(entry['uri'])}, which cannot be read")
            continue
        places[number] = 0, size
        fill = -len(data) % _ALIGNMENT
        parts += [data, b"\0" * fill]
        size += len(data) + fill
    return b"".join(parts), places, outside


def _embed_images(document: Document, writer: GlbWriter, left_out: list[str]) -> None:
    """Move images that are files or inline text into the chunk, each file once."""
    views: dict[str, tuple[int, str]] = {}
    for number, entry in enumerate(writer.json.get("images", [])):
        uri = entry.get("uri")
        if not isinstance(uri, str):
            continue
        if uri not in views:
            try:
                data = document.resource(uri, f"images[{number}].uri")
            except InputError:
                left_out.append(f"images[{number}], {printable(uri)}, which cannot be read")
                continue
            kind = media_type(data) or entry.get("mimeType")
            if kind is None:
                left_out.append(f"images[{number}], {printable(uri)}, which is no PNG or JPEG")
                continue
            views[uri] = writer.view(data), kind
        del entry["uri"]
        entry["bufferView"], entry["mimeType"] = views[uri]
