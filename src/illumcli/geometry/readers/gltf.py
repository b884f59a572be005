"""glTF 2.0, as text with its buffers (.gltf) or in one file (.glb): the triangles of a scene, in world space.

The JSON is walked as it is: a typed object model of it costs 0.16 s of import and checks nothing.

References
----------
The Khronos Group (2021). glTF 2.0 specification, 2.0.1. ISO/IEC 12113:2022.
"""

from __future__ import annotations

import json
import math
from base64 import b64decode
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError, LimitError
from illumcli.geometry.mesh import Mesh
from illumcli.geometry.readers._files import beside, content
from illumcli.geometry.readers._polygons import Ints, check_range, polygons, starts_of, strip
from illumcli.geometry.repairs import Repair, note
from illumcli.records import Value

MOST_CORNERS = 1 << 28  # over all nodes: a mesh may be placed many times, and each is written out

_TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_HARMLESS = (
    "KHR_materials_",
    "KHR_lights_",
    "KHR_texture_",
    "EXT_texture_",
    "KHR_mesh_quantization",
    "KHR_xmp",
)


def read(path: Path) -> Mesh:
    """The triangles of every node of the file's scene, one primitive after the other, in the nodes' order.

    The nodes' transforms are applied. `COLOR_0` becomes the attribute `color` (and `alpha`), an attribute
    that begins with an underscore keeps its name; one that is not on every primitive is left out. Groups
    are the nodes. Skins and morph targets are left out: the mesh stands as its nodes place it. All that is
    left out is counted in `repairs`.
    """
    document = _document(path)
    parts = list(_parts(document))
    sizes = [len(part.vertices) for part in parts]
    firsts = starts_of(np.array(sizes, np.int64)).tolist()
    triangles = [part.triangles + first for part, first in zip(parts, firsts, strict=False)]
    corners = np.concatenate([np.empty((0, 3), np.int64), *triangles]).ravel()
    counts = [len(part.triangles) for part in parts]
    normals, corner_normals = _joined([part.normals for part in parts], sizes, corners)
    uvs, corner_uvs = _joined([part.uvs for part in parts], sizes, corners)
    material_names, materials = _numbered([part.material for part in parts])
    group_names, groups = _numbered([part.group for part in parts])
    return polygons(
        path,
        np.concatenate([np.empty((0, 3)), *(part.vertices for part in parts)]),
        corners,
        np.full(len(corners) // 3, 3),
        normals=normals,
        corner_normals=corner_normals,
        uvs=uvs,
        corner_uvs=corner_uvs,
        material_names=material_names,
        polygon_materials=np.repeat(materials, counts) if material_names else None,
        group_names=group_names,
        polygon_groups=np.repeat(groups, counts),
        attributes=_shared(document, parts),
        repairs=document.repairs,
    )


def _joined(
    tables: list[NDArray[np.float64] | None], sizes: list[int], corners: Ints
) -> tuple[NDArray[np.float64] | None, Ints | None]:
    """The tables one after the other and each corner's row, -1 where a part has no table."""
    width = next((table.shape[1] for table in tables if table is not None), None)
    if width is None:
        return None, None
    filled = [
        np.zeros((size, width)) if table is None else table for table, size in zip(tables, sizes, strict=True)
    ]
    present = np.repeat([table is not None for table in tables], sizes)
    return np.concatenate(filled), np.where(present[corners], corners, -1)


def _numbered(names: list[str | None]) -> tuple[tuple[str, ...], Ints]:
    """The distinct names in order, and the number of each of `names` among them, -1 for none."""
    numbers: dict[str | None, int] = {name: i for i, name in enumerate(dict.fromkeys(n for n in names if n))}
    found = tuple(name for name in numbers if name)
    return found, np.array([numbers.get(name, -1) for name in names], np.int64)


def _shared(document: _Document, parts: list[_Part]) -> dict[str, NDArray[Any]]:
    """The attributes that every part has in the same width; the others are counted."""
    names = sorted({name for part in parts for name in part.attributes})
    shared = {}
    for name in names:
        tables = [part.attributes[name] for part in parts if name in part.attributes]
        if len(tables) == len(parts) and len({table.shape[1:] for table in tables}) == 1:
            shared[name] = np.concatenate(tables)
        else:
            document.count("attributes that some primitives lack, left out")
    return shared


class _Part(Value):
    """One primitive at one node."""

    vertices: NDArray[np.float64]  # (V, 3) in world space
    triangles: Ints  # (T, 3)
    normals: NDArray[np.float64] | None
    uvs: NDArray[np.float64] | None
    attributes: dict[str, NDArray[Any]]
    material: str | None
    group: str


@dataclass(slots=True)
class _Document:
    """The JSON of a file and its buffers; every look into it is checked."""

    path: Path
    json: dict[str, Any]
    chunk: bytes | None
    buffers: dict[int, bytes] = field(default_factory=dict)
    repairs: dict[str, Repair] = field(default_factory=dict)

    def count(self, what: str) -> None:
        note(self.repairs, what)

    def wrong(self, fact: str) -> InputError:
        return InputError(f"{self.path}: {fact}; export the mesh again")

    def item(self, kind: str, index: Any) -> dict[str, Any]:
        """Entry `index` of a top-level list."""
        items = self.json.get(kind, [])
        if not isinstance(items, list) or not _is_index(index) or index >= len(items):
            raise self.wrong(f"refers to {kind}[{index!r:.20}], which is not there")
        if not isinstance(items[index], dict):
            raise self.wrong(f"{kind}[{index}] is no object")
        entry: dict[str, Any] = items[index]
        return entry

    def integer(self, entry: dict[str, Any], key: str, where: str, default: int | None = None) -> int:
        value = entry.get(key, default)
        if not isinstance(value, int) or not _is_index(value) or value > 1 << 53:
            raise self.wrong(f"{where}.{key} must be a whole number from 0, is {value!r:.20}")
        return value

    def numbers(
        self, entry: dict[str, Any], key: str, where: str, default: tuple[float, ...]
    ) -> NDArray[np.float64]:
        values = entry.get(key, default)
        good = isinstance(values, list | tuple) and len(values) == len(default)
        if not good or not all(_is_finite(value) for value in values):
            raise self.wrong(f"{where}.{key} must be {len(default)} finite numbers")
        return np.array(values, np.float64)

    def buffer(self, index: Any) -> bytes:
        """The content of a buffer, as long as announced."""
        if _is_index(index) and index in self.buffers:
            return self.buffers[index]
        entry, where = self.item("buffers", index), f"buffers[{index}]"
        length = self.integer(entry, "byteLength", where)
        uri = entry.get("uri")
        if uri is None:
            if index != 0 or self.chunk is None:
                raise self.wrong(f"{where} has no uri and the file no binary chunk for it")
            data = self.chunk
        elif not isinstance(uri, str):
            raise self.wrong(f"{where}.uri is no text")
        elif uri.startswith("data:"):
            data = self._inline(uri, where)
        elif "://" in uri:
            raise self.wrong(f"{where} is on the network")
        else:
            data = content(beside(self.path, unquote(uri), str(self.path)))
        if len(data) < length:
            raise self.wrong(f"{where} announces {length} bytes and has {len(data)}")
        self.buffers[index] = data[:length]
        return self.buffers[index]

    def _inline(self, uri: str, where: str) -> bytes:
        head, _, body = uri.partition(",")
        try:
            return b64decode(body, validate=True) if head.endswith(";base64") else unquote_to_bytes(body)
        except ValueError:
            raise self.wrong(f"{where}.uri is no readable data URI") from None

    def accessor(self, index: Any, widths: tuple[int, ...]) -> NDArray[Any]:
        """(count, width) values in the file's own type, integers that stand for fractions made so."""
        entry, where = self.item("accessors", index), f"accessors[{index}]"
        kind = entry.get("componentType")
        width = _WIDTHS.get(entry["type"]) if isinstance(entry.get("type"), str) else None
        if not _is_index(kind) or kind not in _TYPES or width not in widths:
            raise self.wrong(
                f"{where} is of type {entry.get('type')!r:.20} of {kind!r:.20}, which is not fit for its use"
            )
        if "sparse" in entry:
            raise self.wrong(f"{where} is sparse, which is not read")
        if "bufferView" not in entry:
            raise self.wrong(f"{where} has no bufferView; compressed meshes are not read")
        view_index = entry["bufferView"]
        view = self.item("bufferViews", view_index)
        buffer = self.buffer(view.get("buffer"))
        view_start = self.integer(view, "byteOffset", f"bufferViews[{view_index}]", 0)
        view_end = view_start + self.integer(view, "byteLength", f"bufferViews[{view_index}]")
        dtype = np.dtype(_TYPES[kind])
        count = self.integer(entry, "count", where)
        stride = self.integer(view, "byteStride", f"bufferViews[{view_index}]", width * dtype.itemsize)
        start = view_start + self.integer(entry, "byteOffset", where, 0)
        end = start + (count - 1) * stride + width * dtype.itemsize
        if count and (end > view_end or view_end > len(buffer) or stride < width * dtype.itemsize):
            raise self.wrong(f"{where} reaches beyond its buffer")
        if not count:
            return np.empty((0, width), dtype)
        values = np.ndarray((count, width), dtype, buffer, start, (stride, dtype.itemsize))
        if entry.get("normalized") and dtype.kind in "iu":
            return np.maximum(values / np.iinfo(dtype).max, -1)
        return values


def _document(path: Path) -> _Document:
    """The JSON of either kind of file, checked to be glTF 2 of a sort that is read here."""
    data = content(path)
    chunk = None
    if data.startswith(b"glTF"):
        data, chunk = _chunks(path, data)
    try:
        parsed = json.loads(data.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        place = f"{path}:{error.lineno}" if isinstance(error, json.JSONDecodeError) else f"{path}"
        raise InputError(f"{place}: is no JSON ({error!s:.80}); export the mesh again") from None
    if not isinstance(parsed, dict) or not isinstance(parsed.get("asset"), dict):
        raise InputError(
            f"{path}: is no glTF file, it has no 'asset'; give the file the suffix of its format"
        )
    version = parsed["asset"].get("version")
    if not isinstance(version, str) or not version.startswith("2."):
        raise InputError(f"{path}: is glTF of version {version!r:.20}; export it as glTF 2")
    needed = parsed.get("extensionsRequired", [])
    for name in needed if isinstance(needed, list) else [needed]:
        if not isinstance(name, str) or not name.startswith(_HARMLESS):
            raise InputError(
                f"{path}: needs the extension {name!r:.60}, which is not read; export it without"
            )
    return _Document(path, parsed, chunk)


def _chunks(path: Path, data: bytes) -> tuple[bytes, bytes | None]:
    """The JSON and the binary chunk of a .glb file."""
    version, length = int.from_bytes(data[4:8], "little"), int.from_bytes(data[8:12], "little")
    if version != 2:
        raise InputError(f"{path}: is binary glTF of version {version}; export it as glTF 2")
    if length != len(data):
        raise InputError(
            f"{path}: announces {length} bytes and has {len(data)}; the file is cut off, export it again"
        )
    chunks: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= length:
        size, kind = int.from_bytes(data[at : at + 4], "little"), data[at + 4 : at + 8]
        at += 8
        if at + size > length:
            raise InputError(f"{path}: a chunk reaches beyond the end of the file; export the mesh again")
        chunks.setdefault(kind, data[at : at + size])
        at += size
    if b"JSON" not in chunks:
        raise InputError(f"{path}: has no JSON chunk; export the mesh again")
    return chunks[b"JSON"], chunks.get(b"BIN\0")


def _parts(document: _Document) -> Iterator[_Part]:
    """Every primitive of triangles at every node of the scene."""
    corners = 0
    for index, world in _nodes(document):
        node = document.item("nodes", index)
        if "mesh" not in node:
            continue
        if "skin" in node:
            document.count("skins left out")
        mesh = document.item("meshes", node["mesh"])
        group = next((str(name) for name in (node.get("name"), mesh.get("name")) if name), f"node {index}")
        primitives = mesh.get("primitives")
        if not isinstance(primitives, list) or not all(isinstance(each, dict) for each in primitives):
            raise document.wrong(f"meshes[{node['mesh']}] has no list of primitives")
        for primitive in primitives:
            part = _part(document, primitive, world, group)
            if part is None:
                continue
            corners += part.triangles.size + len(part.vertices)
            if corners > MOST_CORNERS:
                raise LimitError(
                    f"{document.path}: has more than {MOST_CORNERS} vertices and corners once every node is "
                    "placed; use a smaller mesh"
                )
            yield part


def primitives_of(path: Path) -> list[tuple[int, int, int]]:
    """(mesh, number of the primitive in it, vertices) for each run of vertices, in the order of `read`."""
    document = _document(path)
    found = []
    for index, _ in _nodes(document):
        node = document.item("nodes", index)
        if "mesh" not in node:
            continue
        for number, primitive in enumerate(document.item("meshes", node["mesh"])["primitives"]):
            if primitive.get("mode", _TRIANGLES) >= _TRIANGLES:
                accessor = document.item("accessors", primitive["attributes"]["POSITION"])
                found.append((node["mesh"], number, accessor["count"]))
    return found


def _nodes(document: _Document) -> Iterator[tuple[int, NDArray[np.float64]]]:
    """The nodes of the scene with their (4, 4) transform to world space, each before its children."""
    nodes = document.json.get("nodes", [])
    if not isinstance(nodes, list):
        raise document.wrong("its nodes are no list")
    if "scenes" in document.json:
        roots = document.item("scenes", document.json.get("scene", 0)).get("nodes", [])
    else:
        children = {
            child for node in nodes if isinstance(node, dict) for child in _children(document, node, "nodes")
        }
        roots = [index for index in range(len(nodes)) if index not in children]
    if not isinstance(roots, list):
        raise document.wrong("the scene has no list of nodes")
    open_nodes = [(index, np.eye(4)) for index in reversed(roots)]
    seen: set[int] = set()
    while open_nodes:
        index, parent = open_nodes.pop()
        node = document.item("nodes", index)
        if index in seen:
            raise document.wrong(f"nodes[{index}] has two parents")
        seen.add(index)
        world = parent @ _transform(document, node, f"nodes[{index}]")
        yield index, world
        open_nodes += [(child, world) for child in reversed(_children(document, node, f"nodes[{index}]"))]


def _children(document: _Document, node: dict[str, Any], where: str) -> list[int]:
    children = node.get("children", [])
    if not isinstance(children, list) or not all(_is_index(child) for child in children):
        raise document.wrong(f"{where}.children is no list of nodes")
    return children


def _transform(document: _Document, node: dict[str, Any], where: str) -> NDArray[np.float64]:
    """(4, 4) of a node: its matrix, stored by columns, or translation * rotation * scale."""
    if "matrix" in node:
        return document.numbers(node, "matrix", where, tuple(np.eye(4).ravel())).reshape(4, 4).T
    x, y, z, w = document.numbers(node, "rotation", where, (0.0, 0.0, 0.0, 1.0))
    scale = document.numbers(node, "scale", where, (1.0, 1.0, 1.0))
    norm = x * x + y * y + z * z + w * w
    if not 0 < norm < math.inf:
        raise document.wrong(f"{where}.rotation has no length")
    s = 2 / norm
    rotation = [
        [1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
        [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
        [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)],
    ]
    matrix = np.eye(4)
    matrix[:3, :3] = np.array(rotation) * scale
    matrix[:3, 3] = document.numbers(node, "translation", where, (0.0, 0.0, 0.0))
    return matrix


def _part(
    document: _Document, primitive: dict[str, Any], world: NDArray[np.float64], group: str
) -> _Part | None:
    """A primitive in world space; None where it has no triangles."""
    mode = document.integer(primitive, "mode", "primitive", _TRIANGLES)
    if mode < _TRIANGLES:
        document.count("primitives of points or lines left out")
        return None
    accessors = primitive.get("attributes")
    if mode > _FAN or not isinstance(accessors, dict) or "POSITION" not in accessors:
        raise document.wrong("a primitive has no POSITION, or an unknown mode")
    if primitive.get("targets"):
        document.count("morph targets left out")
    position = document.accessor(accessors["POSITION"], (3,)).astype(np.float64)
    size = len(position)

    def table(name: str, widths: tuple[int, ...]) -> NDArray[Any]:
        values = document.accessor(accessors[name], widths)
        if len(values) != size:
            raise document.wrong(f"{name} has {len(values)} rows for {size} vertices")
        return values

    triangles = _triangles(document, primitive, mode, size)
    linear = world[:3, :3]
    mirrored = np.linalg.det(linear) < 0
    normals = uvs = None
    if "NORMAL" in accessors:
        normals = table("NORMAL", (3,)) @ (_cofactors(linear) * (-1 if mirrored else 1)).T
    if "TEXCOORD_0" in accessors:
        uvs = table("TEXCOORD_0", (2,)).astype(np.float64)
        uvs[:, 1] = 1 - uvs[:, 1]
    attributes: dict[str, NDArray[Any]] = {}
    for name in accessors:
        if name.startswith("_"):
            values = table(name, (1, 2, 3, 4))
            attributes[name] = values[:, 0] if values.shape[1] == 1 else values
    if "COLOR_0" in accessors:
        color = table("COLOR_0", (3, 4)).astype(np.float32)
        attributes["color"] = color[:, :3]
        if color.shape[1] == 4:
            attributes["alpha"] = color[:, 3]
    return _Part(
        vertices=position @ linear.T + world[:3, 3],
        triangles=triangles[:, ::-1] if mirrored else triangles,
        normals=normals,
        uvs=uvs,
        attributes=attributes,
        material=_material(document, primitive),
        group=group,
    )


def _triangles(document: _Document, primitive: dict[str, Any], mode: int, size: int) -> Ints:
    """(T, 3) vertices of the primitive's triangles, wound alike."""
    if "indices" in primitive:
        values = document.accessor(primitive["indices"], (1,))
        if values.dtype.kind != "u":
            raise document.wrong("the indices of a primitive are no whole numbers")
        indices = values[:, 0].astype(np.int64)
        check_range(
            indices,
            size,
            lambda at: document.wrong(
                f"index {indices[at]} of a primitive is out of range, it has {size} vertices"
            ),
        )
    else:
        indices = np.arange(size)
    if mode == _TRIANGLES:
        if len(indices) % 3:
            raise document.wrong(f"a primitive of triangles has {len(indices)} corners")
        return indices.reshape(-1, 3)
    if mode == _STRIP:
        triangles, joints = strip(indices)
        if joints:
            note(document.repairs, "triangles that only join strips", count=joints)
        return triangles
    spokes = (
        np.stack([indices[1:-1], indices[2:]], axis=1) if len(indices) > 2 else np.empty((0, 2), np.int64)
    )
    return np.insert(spokes, 0, indices[:1] if len(spokes) else 0, axis=1)


def _material(document: _Document, primitive: dict[str, Any]) -> str | None:
    if "material" not in primitive:
        return None
    name = document.item("materials", primitive["material"]).get("name")
    return name if isinstance(name, str) and name else f"material {primitive['material']}"


def _cofactors(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """The inverse transpose times the determinant, which a flattening transform has too."""
    a, b, c = matrix
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)])


def _is_index(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _is_finite(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= 1e18
