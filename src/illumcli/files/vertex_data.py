"""Baked obscurance in files: npz, PLY and GLB, in the order of the mesh's own vertices."""

from __future__ import annotations

import hashlib
import json
import os
import struct
import zipfile
from collections.abc import Container, Mapping, Sequence
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

SUFFIXES = (".npz", ".ply", ".glb")
STANDARD = ("normal", "uv", "color")
"""Attributes of a shape that every format has a form of its own for; all others are the file's own."""
CHANNELS = {"r": (0,), "g": (1,), "b": (2,), "a": (3,), "rgb": (0, 1, 2)}

_FLOAT, _UBYTE, _UINT = 5126, 5121, 5125  # glTF component types
_VERTICES, _INDICES = 34962, 34963  # glTF targets of a buffer view
_JSON, _BIN = 0x4E4F534A, 0x004E4942


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
        """(V,) values of the mesh of `count` vertices, in a bake of several that of the object `name`; None
        where there is none that long."""
        return self._part(self.obscurance, "vertices", name, count)

    def of_corners(self, name: str, corners: NDArray[np.int32], count: int) -> NDArray[np.float32] | None:
        """(C,) the same at the mesh's corners, (C,) vertex numbers: their own values, else the vertices'."""
        values, own = self.of(name, count), None
        if self.corner_obscurance is not None:
            own = self._part(self.corner_obscurance, "corners", name, len(corners))
        return values[corners] if own is None and values is not None else own

    def _part(
        self, values: NDArray[np.float32], what: str, name: str, count: int
    ) -> NDArray[np.float32] | None:
        if len(values) == count:
            return values
        first = 0
        for own, size in dict(self.about.get(what, {})).items():
            if own == name and size == count:
                return values[first : first + count]
            first += size
        return None

    def hashes(self) -> list[str]:
        """Of the meshes that were baked."""
        return list(dict(self.about.get("meshes", {})).values())

    def columns(self) -> dict[str, NDArray[np.float32]]:
        """What is written of every vertex, by name."""
        found = {"obscurance": self.obscurance, "standard_error": self.standard_error}
        return found if self.bent_normal is None else {**found, "bent_normal": self.bent_normal}

    def corner_columns(self) -> dict[str, NDArray[np.float32]]:
        """What is written of every corner, by name; nothing where no vertex has several values."""
        names = ("corner_obscurance", "corner_standard_error", "corner_bent_normal")
        return {name: values for name in names if (values := getattr(self, name)) is not None}


class Shape(Record):
    """One object as it is written: polygons over vertices that keep their order and count."""

    name: str
    vertices: NDArray[np.float64]  # (V, 3)
    corners: NDArray[np.int32]  # (C,) vertex of each polygon corner
    starts: NDArray[np.int32]  # (P + 1,)
    triangles: NDArray[np.int32]  # (T, 3) vertex numbers
    attributes: Mapping[str, NDArray[Any]]  # per vertex: `normal`, `uv`, `color` (linear) and the file's own


def mesh_hash(vertices: NDArray[np.float64], corners: NDArray[np.int32], starts: NDArray[np.int32]) -> str:
    """Hash of a mesh's geometry, 32 hexadecimal digits, the same from whatever file it was read."""
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
            file.seek(-2, os.SEEK_END)  # the length of the archive's comment, which is its end
            file.write(struct.pack("<H", len(BLANK)) + BLANK.encode())
        seal(part.path)


def _sealed(baked: Baked) -> dict[str, Any]:
    """What a PLY or GLB says of itself, with a place for its hash."""
    return {**baked.about, "body": BLANK}


def refuse_unpacked(path: Path) -> None:
    """Raise LimitError where what an archive packs does not fit into memory; a small file may hold much."""
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
            made = Baked(**arrays, about=about)
    except LimitError:
        raise
    except Exception as why:  # zipfile, numpy and json each have their own
        raise InputError(f"{path}: is no baked obscurance ({why}); bake it with illum ao-bake") from why
    values = [made.obscurance, *(() if made.corner_obscurance is None else (made.corner_obscurance,))]
    sound = all(w.ndim == 1 and np.isfinite(w).all() and (w >= 0).all() and (w <= 1).all() for w in values)
    if not sound or made.standard_error.shape != made.obscurance.shape:
        raise InputError(f"{path}: obscurance must be one number from 0 to 1 per vertex; bake it again")
    return made


def read_content(path: Path) -> str | None:
    """The hash of what a baked file was made from; None where it is no such file."""
    try:
        if path.suffix.lower() == ".npz":
            refuse_unpacked(path)
            with np.load(path, allow_pickle=False) as data:
                found = json.loads(str(data["about"]))["content"]
        elif path.suffix.lower() == ".glb":
            found = _read_glb(path)[0]["asset"]["extras"]["illum"]["content"]
        else:
            with path.open("rb") as file:
                header = file.read(1 << 16).partition(b"end_header")[0].decode("latin-1")
            line = next(line for line in header.splitlines() if line.startswith("comment illum "))
            found = json.loads(line.removeprefix("comment illum "))["content"]
        return found if isinstance(found, str) else None
    except Exception:  # whatever it is, it is not ours
        return None


# --- PLY ----------------------------------------------------------------------------------------------


def write_ply(
    path: Path, shapes: Sequence[Shape], baked: Baked, source: Path | None, channel: str | None
) -> None:
    """The mesh with float properties `obscurance`, `quality` (the same, as MeshLab reads it) and
    `standard_error`, and `nx_bent ny_bent nz_bent` where the bent normal was asked for.

    A PLY `source` is written again with every element and property it has, in its own encoding. Other meshes
    are binary; normals, uv and colours are kept where every vertex has one of its own.

    Parameters
    ----------
    channel : {"r", "g", "b", "a", "rgb"}, optional
        Where to write obscurance as 8-bit colour; other channels stay, or are white.
    """
    from plyfile import PlyData, PlyElement

    line = "illum " + json.dumps(_sealed(baked))
    added = _ply_columns(baked)
    if source is not None:
        old = PlyData.read(source)
        elements = [
            _with_columns(each, added, baked, channel) if each.name == "vertex" else each for each in old
        ]
        comments = [each for each in old.comments if not each.startswith("illum ")]
        made = PlyData(elements, old.text, old.byte_order, [*comments, line], list(old.obj_info))
    else:
        first = np.cumsum([0, *(len(shape.vertices) for shape in shapes)])
        named = _joined(shapes) | added
        table = np.empty(len(baked.obscurance), [(name, each.dtype) for name, each in named.items()])
        for name, each in named.items():
            table[name] = each
        vertex = _with_columns(PlyElement.describe(table, "vertex"), {}, baked, channel)
        made = PlyData([vertex, _faces(shapes, first)], False, "<", [line])
    with AtomicFile(path) as part:
        made.write(str(part.path))
        seal(part.path)


def _ply_columns(baked: Baked) -> dict[str, NDArray[np.float32]]:
    columns = {"obscurance": baked.obscurance, "quality": baked.obscurance}
    columns["standard_error"] = baked.standard_error
    if baked.bent_normal is not None:
        for axis, name in enumerate("xyz"):
            columns[f"n{name}_bent"] = baked.bent_normal[:, axis]
    return columns


def _with_columns(element: Any, added: Mapping[str, NDArray[Any]], baked: Baked, channel: str | None) -> Any:
    """The element with these columns, and colours where asked for, new or in place of their namesakes."""
    from plyfile import PlyElement, PlyProperty

    columns = dict(added)
    if channel is not None:
        columns |= _ply_colors(element.data, eight_bit(baked.obscurance), channel)
    if not columns:
        return element
    kept = [each for each in element.properties if each.name not in columns]
    kinds = [(each.name, element.data.dtype[each.name]) for each in kept]
    table = np.empty(len(element.data), [*kinds, *((name, each.dtype) for name, each in columns.items())])
    for each in kept:
        table[each.name] = element.data[each.name]
    for name, values in columns.items():
        table[name] = values
    more = [
        PlyProperty(name, "uchar" if each.dtype == np.uint8 else "float") for name, each in columns.items()
    ]
    new = PlyElement("vertex", [*kept, *more], len(table), list(element.comments))
    new.data = table
    return new


def _ply_colors(data: Any, value: NDArray[np.uint8], channel: str) -> dict[str, NDArray[np.uint8]]:
    names = ("red", "green", "blue", "alpha")
    wanted = CHANNELS[channel]
    found = {}
    for number, name in enumerate(names):
        if number in wanted:
            found[name] = value
        elif name not in data.dtype.names and number < 3:
            found[name] = np.full(len(value), 255, np.uint8)
    return found


def eight_bit(w: NDArray[np.float32]) -> NDArray[np.uint8]:
    """(V,) linear 0..255, rounded."""
    return np.rint(w * 255).astype(np.uint8)


def _joined(shapes: Sequence[Shape]) -> dict[str, NDArray[Any]]:
    """PLY columns of all shapes, one after the other: those that every shape has."""
    vertices = np.concatenate([shape.vertices for shape in shapes])
    kind = np.float32 if fits_single(vertices) else np.float64
    columns: dict[str, NDArray[Any]] = {name: vertices[:, k].astype(kind) for k, name in enumerate("xyz")}
    common = set.intersection(*(set(shape.attributes) for shape in shapes))
    for name in sorted(common, key=lambda name: (name not in STANDARD, name)):
        parts = [np.asarray(shape.attributes[name]) for shape in shapes]
        if len({part.shape[1:] for part in parts}) > 1:
            continue
        values = np.concatenate(parts)
        if name == "color":
            values = srgb_bytes(values)
        if values.dtype.kind == "f":
            values = values.astype(np.float32)
        for label, column in zip(_labels(name, values), _flat(values), strict=True):
            columns[free_name(label, columns)] = column
    return columns


def free_name(name: str, taken: Container[str]) -> str:
    """`name`, with underscores behind it until it is not taken."""
    while name in taken:
        name += "_"
    return name


def _flat(values: NDArray[Any]) -> list[NDArray[Any]]:
    return [values] if values.ndim == 1 else list(values.T)


def _labels(name: str, values: NDArray[Any]) -> list[str]:
    known = {"normal": ["nx", "ny", "nz"], "uv": ["s", "t"], "color": ["red", "green", "blue"]}
    if name in known:
        return known[name]
    return [name] if values.ndim == 1 else [f"{name}_{k}" for k in range(values.shape[1])]


def _faces(shapes: Sequence[Shape], first: NDArray[np.int64]) -> Any:
    """Polygons as the mesh has them, of all shapes."""
    from plyfile import PlyElement

    rows = np.empty(sum(len(shape.starts) - 1 for shape in shapes), [("vertex_indices", object)])
    lists = []
    for shape, offset in zip(shapes, first, strict=False):
        lists += np.split((shape.corners + offset).astype(np.int32), shape.starts[1:-1])
    rows["vertex_indices"][:] = [*lists, None][:-1]  # one list per row, however long they are
    return PlyElement.describe(rows, "face", len_types={"vertex_indices": "u4" if _long(shapes) else "u1"},
                               val_types={"vertex_indices": "i4"})  # fmt: skip


def _long(shapes: Sequence[Shape]) -> bool:
    return max(int(np.diff(shape.starts).max(initial=0)) for shape in shapes) > 255


def fits_single(vertices: NDArray[np.float64]) -> bool:
    """Does rounding to single precision move no vertex by more than 10^-6 of the mesh's size?"""
    size = float(np.ptp(vertices, axis=0).max()) if len(vertices) else 0.0
    return bool(np.abs(vertices - vertices.astype(np.float32)).max(initial=0) <= 1e-6 * size)


def srgb_bytes(linear: NDArray[Any]) -> NDArray[np.uint8]:
    """Colours as PLY files have them."""
    x = np.clip(np.asarray(linear, np.float64), 0, 1)
    return np.rint(255 * np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)).astype(np.uint8)


# --- GLB ----------------------------------------------------------------------------------------------


class _Buffer:
    """The binary part of a GLB in the making, and what the JSON says of it."""

    def __init__(self, document: dict[str, Any], data: bytes = b"") -> None:
        self.document, self.parts, self.size = document, [data], len(data)

    def add(self, values: NDArray[Any], target: int, bounds: bool = False) -> int:
        """Number of the accessor of a (N,) or (N, k) array."""
        raw = np.ascontiguousarray(values)
        fill = -self.size % 4
        view = {"buffer": 0, "byteOffset": self.size + fill, "byteLength": raw.nbytes, "target": target}
        self.parts += [b"\0" * fill, raw.tobytes()]
        self.size += fill + raw.nbytes
        views = self.document.setdefault("bufferViews", [])
        accessors = self.document.setdefault("accessors", [])
        kind = {"f4": _FLOAT, "u1": _UBYTE, "u4": _UINT}[raw.dtype.str[1:]]
        width = "SCALAR" if raw.ndim == 1 else f"VEC{raw.shape[1]}"
        accessor = {"bufferView": len(views), "componentType": kind, "count": len(raw), "type": width}
        if raw.dtype == np.uint8:
            accessor["normalized"] = True
        if bounds:
            accessor |= {"min": raw.min(axis=0).tolist(), "max": raw.max(axis=0).tolist()}
        views.append(view)
        accessors.append(accessor)
        return len(accessors) - 1

    def write(self, path: Path) -> None:
        """The GLB, whole or not at all."""
        data = b"".join(self.parts)
        data += b"\0" * (-len(data) % 4)
        self.document["buffers"] = [{"byteLength": len(data)}, *self.document.get("buffers", [])[1:]]
        text = json.dumps(self.document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        with AtomicFile(path) as part:
            with part.path.open("wb") as file:
                file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data)))
                file.write(struct.pack("<II", len(text), _JSON) + text)
                file.write(struct.pack("<II", len(data), _BIN) + data)
            seal(part.path)


def write_glb(path: Path, shapes: Sequence[Shape], baked: Baked, channel: str | None) -> None:
    """A node per shape with its vertices in their order and `_OBSCURANCE`, `_STANDARD_ERROR`, float each.

    Polygons become triangles. Vertices are stored from the shape's centre, which its node carries, so that a
    mesh far from the origin keeps its digits. `COLOR_0` only where a `channel` is asked for: viewers multiply
    all light by it, not the ambient light alone.
    """
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "illum", "extras": {"illum": _sealed(baked)}},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(shapes)))}],
        "nodes": [],
        "meshes": [],
    }
    buffer = _Buffer(document)
    first = 0
    for number, shape in enumerate(shapes):
        part = slice(first, first + len(shape.vertices))
        first = part.stop
        node = {"mesh": number, "name": shape.name}
        vertices = shape.vertices
        if not fits_single(vertices):
            centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
            node["translation"] = centre.tolist()
            vertices = vertices - centre
        attributes = {"POSITION": buffer.add(vertices.astype("<f4"), _VERTICES, bounds=True)}
        for name, values in sorted(shape.attributes.items(), key=lambda each: each[0] not in STANDARD):
            label = {"normal": "NORMAL", "uv": "TEXCOORD_0"}.get(name)
            values = np.asarray(values)
            if name == "color" and channel is None:
                attributes["COLOR_0"] = buffer.add(values.astype("<f4"), _VERTICES)
            elif label is None and name != "color":
                label = name if name.startswith("_") else "_" + name.upper()
            if label is not None and (values.ndim == 1 or values.shape[1] in (2, 3, 4)):
                values = unit_rows(values) if name == "normal" else values
                if name == "uv":
                    values = values * [1, -1] + [0, 1]  # glTF counts v downwards
                attributes[free_name(label, attributes)] = buffer.add(values.astype("<f4"), _VERTICES)
        own = {f"_{name.upper()}": column[part] for name, column in baked.columns().items()}
        for name, column in own.items():
            attributes[name] = buffer.add(column.astype("<f4"), _VERTICES)
        if channel is not None:
            color = np.full((len(vertices), 4), 255, np.uint8)
            if "color" in shape.attributes:
                color[:, :3] = np.rint(255 * np.clip(shape.attributes["color"], 0, 1))
            color[:, CHANNELS[channel]] = eight_bit(baked.obscurance[part])[:, None]
            attributes["COLOR_0"] = buffer.add(color, _VERTICES)
        indices = buffer.add(shape.triangles.astype("<u4").ravel(), _INDICES)
        document["nodes"].append(node)
        document["meshes"].append({"primitives": [{"attributes": attributes, "indices": indices}]})
    buffer.write(path)


def add_to_glb(
    path: Path, source: tuple[dict[str, Any], bytes], counts: Sequence[tuple[int, int, int]], baked: Baked
) -> None:
    """A GLB with `_OBSCURANCE` and `_STANDARD_ERROR` added to each primitive, all else as it is.

    Parameters
    ----------
    source : (dict, bytes)
        The JSON of the input, which is changed, and its binary chunk.
    counts : sequence of (mesh, primitive, vertices)
        The primitives in the order of the baked vertices, each once.
    """
    document, data = source
    buffer = _Buffer(document, data)
    extras = document["asset"].get("extras")
    about = {"illum": _sealed(baked)}
    document["asset"]["extras"] = {**extras, **about} if isinstance(extras, dict) else about
    first = 0
    for mesh, primitive, count in counts:
        attributes = document["meshes"][mesh]["primitives"][primitive]["attributes"]
        for name, column in baked.columns().items():
            attributes[f"_{name.upper()}"] = buffer.add(
                column[first : first + count].astype("<f4"), _VERTICES
            )
        first += count
    buffer.write(path)


def _read_glb(path: Path) -> tuple[dict[str, Any], bytes]:
    """JSON and binary chunk of a GLB."""
    data = path.read_bytes()
    size, kind = struct.unpack_from("<II", data, 12)
    if data[:4] != b"glTF" or kind != _JSON:
        raise InputError(f"{path}: is no GLB; export it again")
    document = json.loads(data[20 : 20 + size])
    binary = (
        data[28 + size : 28 + size + struct.unpack_from("<I", data, 20 + size)[0]]
        if len(data) > 20 + size
        else b""
    )
    return document, binary


def unit_rows(values: NDArray[Any]) -> NDArray[np.float64]:
    """(V, 3) of length 1, (0, 0, 1) for zero: glTF takes unit normals only."""
    size = np.linalg.norm(values, axis=1, keepdims=True)
    return np.where(size > 0, values / np.where(size > 0, size, 1), [0.0, 0.0, 1.0])
