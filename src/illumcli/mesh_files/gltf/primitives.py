"""The triangles of a glTF scene: every primitive at every node, in world space (specification, 3.7.2)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError, LimitError
from illumcli.mesh_files._polygons import Ints, strip
from illumcli.mesh_files.gltf.accessors import has_data, table
from illumcli.mesh_files.gltf.deformation import morphed, skinned_or_placed, weights_of
from illumcli.mesh_files.gltf.document import Document, extensions, is_index, printable
from illumcli.mesh_files.gltf.nodes import PlacedNode, placed_nodes
from illumcli.records import Record

MOST_CORNERS = 1 << 28
"""Most vertices and corners over all nodes: each placement of a mesh is a copy."""

_TRIANGLES, _STRIP, _FAN = 4, 5, 6

Floats = NDArray[np.float64]


class Part(Record):
    """One primitive at one node, with all of its instances one after the other."""

    node: int
    """Number of the node; -1 if the file has meshes but no nodes."""
    mesh: int
    primitive: int
    """Number of the primitive in its mesh."""
    copies: int
    is_reversed: NDArray[np.bool_]  # (copies,) True for copies whose triangles are reversed
    vertices: Floats  # (V, 3) in world space
    triangles: Ints  # (T, 3)
    normals: Floats | None  # (V, 3) unit, or 0 if the file has 0
    uvs: dict[int, Floats]  # (V, 2) by number of the uv set, v upwards
    attributes: dict[str, NDArray[Any]]  # (V,) or (V, k)
    material: int | None
    group: str


def parts(document: Document) -> Iterator[Part]:
    """Every primitive of triangles at every node of the scene.

    Raises
    ------
    InputError
        Positions or indices that are missing or compressed.
    LimitError
        More than `MOST_CORNERS` vertices and corners.
    """
    corners = 0
    for placed in placed_nodes(document):
        number = placed.node["mesh"]
        mesh = document.item("meshes", number)
        primitives = mesh.get("primitives")
        if not isinstance(primitives, list) or not all(isinstance(each, dict) for each in primitives):
            raise document.wrong(f"meshes[{number}] has no list of primitives")
        for i, primitive in enumerate(primitives):
            where = f"meshes[{number}].primitives[{i}]"
            if not _is_drawn(document, primitive, where):
                continue
            position = table(document, primitive["attributes"]["POSITION"], (3,))
            triangles = _triangles(document, primitive, len(position), where)
            corners += len(placed.worlds) * (triangles.size + len(position))
            if corners > MOST_CORNERS:
                raise LimitError(
                    f"{document.path}: has more than {MOST_CORNERS} vertices and corners once every node is "
                    "placed; use a smaller mesh"
                )
            yield _part(document, placed, (number, i), position, triangles)


def _is_drawn(document: Document, primitive: dict[str, Any], where: str) -> bool:
    """True if a primitive has triangles whose vertices have positions; refused if these are compressed."""
    mode = primitive.get("mode", _TRIANGLES)
    if not is_index(mode) or mode > _FAN:
        document.count("primitives of an unknown mode, left out", where)
        return False
    if mode < _TRIANGLES:
        document.count("primitives of points or lines left out", where)
        return False
    attributes = primitive.get("attributes")
    needed = [attributes.get("POSITION") if isinstance(attributes, dict) else None]
    if needed[0] is None:
        document.count("primitives without POSITION, left out", where)
        return False
    needed += [primitive["indices"]] if "indices" in primitive else []
    names = ", ".join(
        printable(name) for name, extension in extensions(primitive).items() if "bufferView" in extension
    )
    if names and not all(has_data(document, each) for each in needed):
        raise document.wrong(
            f"{where} has its geometry in the extension {names:.80} alone, which is not read",
            "export the mesh without compression",
        )
    return True


def _part(
    document: Document,
    placed: PlacedNode,
    numbers: tuple[int, int],
    position: NDArray[Any],
    triangles: Ints,
) -> Part:
    """A primitive in world space, at each instance of its node; `numbers` are of its mesh and its own."""
    where = f"meshes[{numbers[0]}].primitives[{numbers[1]}]"
    mesh = document.item("meshes", numbers[0])
    primitive = mesh["primitives"][numbers[1]]
    accessors = primitive["attributes"]
    weights = weights_of(document, placed.node, mesh, where)

    # Positions and normals in object space, with the default weights of morph targets.
    size = len(position)
    tables = _Tables(document, accessors, size, where)
    position = morphed(document, position.astype(np.float64), "POSITION", primitive, weights)
    normals = tables.optional("NORMAL", (3,))
    if normals is not None:
        normals = morphed(document, normals.astype(np.float64), "NORMAL", primitive, weights)

    # To world space, by the matrix of each instance (I, 1, 4, 4), or of each vertex (1, V, 4, 4).
    worlds = skinned_or_placed(document, placed, accessors, size, where)
    linear = worlds[..., :3, :3]
    is_mirrored = np.linalg.det(linear) < 0
    vertices = _applied(linear, position) + worlds[..., :3, 3]
    if normals is not None:
        sides = np.where(is_mirrored, -1, 1)[..., None, None]
        normals = _unit(_applied(_cofactors(linear) * sides, normals).reshape(-1, 3))

    # Instances that are mirrored, by most of their vertices, have reversed triangles.
    copies = len(vertices)
    reverse = 2 * np.count_nonzero(is_mirrored, axis=1) > is_mirrored.shape[1]
    oriented = np.where(reverse[:, None, None], triangles[:, ::-1], triangles)

    name = next((str(each) for each in (placed.node.get("name"), mesh.get("name")) if each), None)
    return Part(
        node=placed.index,
        mesh=numbers[0],
        primitive=numbers[1],
        copies=copies,
        is_reversed=reverse,
        vertices=vertices.reshape(-1, 3),
        triangles=(oriented + size * np.arange(copies)[:, None, None]).reshape(-1, 3),
        normals=normals,
        uvs={key: _repeated(values, copies) for key, values in _uvs(tables).items()},
        attributes={key: _repeated(values, copies) for key, values in _attributes(tables).items()},
        material=_material(document, primitive, where),
        group=name or (f"node {placed.index}" if placed.index >= 0 else f"mesh {numbers[0]}"),
    )


class _Tables(Record):
    """The attributes of a primitive; one that cannot be read is left out and counted."""

    document: Document
    accessors: dict[str, Any]
    size: int  # vertices
    where: str

    def optional(self, name: str, widths: tuple[int, ...], fractions: bool = False) -> NDArray[Any] | None:
        """(V, width) values, or None."""
        if name not in self.accessors:
            return None
        try:
            values = table(self.document, self.accessors[name], widths, fractions)
            if len(values) != self.size:
                raise self.document.wrong(f"{name} has {len(values)} rows for {self.size} vertices")
        except InputError:
            self.document.count(f"{printable(name)} that cannot be read, left out", self.where)
            return None
        return values


def _uvs(tables: _Tables) -> dict[int, Floats]:
    """Texture coordinates by number of the uv set, v upwards; integers are fractions unless quantised."""
    used = tables.document.json.get("extensionsUsed")
    fractions = not (isinstance(used, list) and "KHR_mesh_quantization" in used)
    sets = {}
    for name in tables.accessors:
        if name.startswith("TEXCOORD_") and name[9:].isdecimal():
            uv = tables.optional(name, (2,), fractions)
            if uv is not None:
                sets[int(name[9:])] = uv.astype(np.float64) * (1, -1) + (0, 1)
    return sets


def _attributes(tables: _Tables) -> dict[str, NDArray[Any]]:
    """`COLOR_0` as `color`, linear (3.7.2.1), and `alpha`; attributes with a leading underscore by name."""
    columns: dict[str, NDArray[Any]] = {}
    for name in tables.accessors:
        if name.startswith("_"):
            values = tables.optional(name, (1, 2, 3, 4))
            if values is not None:
                columns[name] = values[:, 0] if values.shape[1] == 1 else values
    color = tables.optional("COLOR_0", (3, 4), fractions=True)
    if color is not None:
        columns["color"] = color[:, :3].astype(np.float32)
        if color.shape[1] == 4:
            columns["alpha"] = color[:, 3].astype(np.float32)
    return columns


def _triangles(document: Document, primitive: dict[str, Any], size: int, where: str) -> Ints:
    """(T, 3) vertices of the primitive's triangles, with equal winding; those with invalid ones are
    dropped."""
    # The indices.
    if "indices" in primitive:
        values = table(document, primitive["indices"], (1,))[:, 0]
        indices = values.astype(np.int64)
        if not np.array_equal(indices, values):
            raise document.wrong(f"{where} has indices that are no whole numbers")
    else:
        indices = np.arange(size)

    # Invalid ones become -1: in some files the end of a strip, otherwise a fault.
    indices = np.where((indices >= 0) & (indices < size), indices, -1)
    mode = primitive.get("mode", _TRIANGLES)
    if mode == _TRIANGLES:
        if surplus := len(indices) % 3:
            document.count("corners behind the last whole triangle", where, surplus)
        triangles = indices[: len(indices) - surplus].reshape(-1, 3)
    elif mode == _STRIP:
        triangles, joints = strip(indices)
        if joints:
            document.count("triangles that only join strips", where, joints)
    else:
        triangles = _fans(indices)
    complete = (triangles >= 0).all(axis=1)
    lost = np.count_nonzero(indices < 0) if mode != _TRIANGLES else np.count_nonzero(~complete)
    if lost:
        document.count("triangles of vertices that are not there, left out", where, int(lost))
    return triangles[complete]


def _fans(indices: Ints) -> Ints:
    """(T, 3) triangles of fans; -1 ends one."""
    fans = []
    for fan in np.split(indices, np.flatnonzero(indices < 0)):
        corners = fan[fan >= 0]
        if len(corners) > 2:
            fans.append(np.stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]], axis=1))
    return np.concatenate([np.empty((0, 3), np.int64), *fans])


def _material(document: Document, primitive: dict[str, Any], where: str) -> int | None:
    """Number of the primitive's material."""
    number = primitive.get("material")
    if number is None:
        return None
    materials = document.json.get("materials")
    known = materials if isinstance(materials, list) else []
    if not is_index(number) or number >= len(known) or not isinstance(known[number], dict):
        document.count("materials that are not there", where)
        return None
    return int(number)


def _applied(linear: Floats, vectors: Floats) -> Floats:
    """(I, V, 3) transformed vectors, (V, 3), by matrices of instances (I, 1, 3, 3) or vertices (1, V, 3,
    3)."""
    if linear.shape[1] == 1:
        return vectors @ linear[:, 0].transpose(0, 2, 1)
    transformed: Floats = np.einsum("ivab,vb->iva", linear, vectors)
    return transformed


def _repeated(values: NDArray[Any], copies: int) -> NDArray[Any]:
    return values if copies == 1 else np.concatenate([values[:0], *[values] * copies])


def _cofactors(matrices: Floats) -> Floats:
    """(..., 3, 3) inverse transposes times the determinants; they exist for singular matrices, too."""
    a, b, c = np.moveaxis(matrices, -2, 0)
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-2)


def _unit(vectors: Floats) -> Floats:
    size = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, size, out=np.zeros_like(vectors), where=size > 0)
