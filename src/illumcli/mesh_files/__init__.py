"""Mesh files: one module per format, its name the suffix it reads."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path, PureWindowsPath

import numpy as np

from illumcli.errors import IllumError, InputError, LimitError
from illumcli.geometry.mesh import Mesh
from illumcli.schema.families import modules

MOST_WORDS = 128  # of a line that names files, with the blanks between them
LONGEST_PLY_HEADER = 1 << 20  # [bytes]
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
    return {f".{name}": name for name in modules(__path__)} | OTHER_SUFFIXES


def image_within(texture: str) -> tuple[str, int] | None:
    """The mesh file and the number of the image in it, where that is what a mesh's own library names as a
    texture (`a.glb#images[2]`)."""
    found = re.fullmatch(r"(.*)#images\[(\d+)\]", texture, re.DOTALL)
    return (found[1], int(found[2])) if found else None


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


def companions(path: Path) -> list[Path]:
    """The files that a mesh file may name, whether they are there or not: material libraries with their
    textures, buffers; more of them than are read, never fewer, and none outside the folder of the mesh."""
    suffix = path.suffix.lower()
    if suffix == ".obj":
        libraries = _named(path, _LIBRARY, path.parent)
        images = [
            each
            for library in libraries
            if library.is_file()
            for each in _named(library, _IMAGE, path.parent)
        ]
        return [*libraries, *images]
    if suffix in (".gltf", ".glb"):
        return _named(path, _URI, path.parent)
    if suffix == ".ply":
        return _named(path, _TEXTURE, path.parent, LONGEST_PLY_HEADER)
    return []


_LIBRARY = re.compile(rb"mtllib[ \t]([^\r\n]*)", re.IGNORECASE)
_IMAGE = re.compile(rb"map_kd[ \t]([^\r\n]*)", re.IGNORECASE)
_TEXTURE = re.compile(rb"comment[ \t]+texturefile[ \t]([^\r\n]*)", re.IGNORECASE)
_URI = re.compile(rb'"uri"\s*:\s*"([^"]{1,4096})"')


def _named(path: Path, pattern: re.Pattern[bytes], folder: Path, most: int | None = None) -> list[Path]:
    """The paths inside `folder` that the text of `path`, its first `most` bytes, may mean where it names
    files."""
    from illumcli.mesh_files._files import beside, content

    try:
        data = content(path, most)
    except IllumError:  # whoever reads the file says what is wrong with it
        return []
    if pattern is _LIBRARY and b"\\" in data:  # a line that goes on in the next
        data = re.sub(rb"\\[ \t]*\r?\n", b" ", data)
    texts = map(_unescaped, pattern.findall(data)) if pattern is _URI else pattern.findall(data)
    names = dict.fromkeys(name for said in texts for name in _names(said))
    found: dict[Path, None] = {}
    for name in names:
        for start in (path, folder / path.name):
            with suppress(InputError):
                found[beside(start, name, str(path), folder)] = None
    return list(found)


def _unescaped(said: bytes) -> bytes:
    """A text of JSON without its backslashes."""
    try:
        return str(json.loads(b'"' + said + b'"', strict=False)).encode("utf-8", "replace")
    except ValueError:
        return said


def _names(said: bytes) -> Iterator[str]:
    """The names that may be meant: all of it, what follows any word, each word; with folders and without."""
    from urllib.parse import unquote

    from illumcli.mesh_files._files import LONGEST_NAME
    from illumcli.mesh_files._text import decoded, without_comment

    text = decoded(said[:LONGEST_NAME]).strip()
    if text.startswith("data:"):
        return
    words = re.split(r"(\s+)", text)
    tails = ("".join(words[k:]) for k in range(0, min(len(words), MOST_WORDS), 2))
    for name in (*tails, *words[:MOST_WORDS:2]):
        for each in (name, unquote(name), without_comment(name).rstrip(), name.strip("\"'")):
            if each and "\0" not in each:
                yield each
                yield PureWindowsPath(each).name
