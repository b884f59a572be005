"""Transforms of the nodes of a glTF scene (glTF 2.0 specification, 3.5) and of their instances."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import LimitError
from illumcli.mesh_files.gltf.accessors import table
from illumcli.mesh_files.gltf.document import Document, extension, is_index
from illumcli.records import Record

Matrix = NDArray[np.float64]

MOST_NODES = 1 << 22
"""Most nodes that are visited; a node with several parents is visited through each."""
MOST_INSTANCES = 1 << 22
"""Most instances at one node."""


class PlacedNode(Record):
    """A node of the scene that has a mesh, with its transforms to world space."""

    index: int
    """Its number; -1 if the file has meshes but no nodes."""
    node: dict[str, Any]
    worlds: Matrix  # (I, 4, 4) to world space: one, or one per instance


def placed_nodes(document: Document) -> Iterator[PlacedNode]:
    """The visible nodes that have a mesh, each before its children, in the order of the file.

    Raises
    ------
    InputError
        Nodes that do not exist, that are among their own descendants, or that have a malformed transform.
    """
    if not document.items("nodes"):  # a library of meshes, without transforms
        for index in range(len(document.items("meshes"))):
            yield PlacedNode(-1, {"mesh": index}, np.eye(4)[None])
        return
    todo = [(index, np.eye(4), 0) for index in reversed(_roots(document))]
    path: list[int] = []
    above: set[int] = set()
    visited = 0
    while todo:
        # Leave the nodes that are not above the next one.
        index, parent, depth = todo.pop()
        while len(path) > depth:
            above.discard(path.pop())
        if index in above:
            raise document.wrong(f"nodes[{index}] is among its own descendants")
        if (visited := visited + 1) > MOST_NODES:
            raise LimitError(f"{document.path}: places more than {MOST_NODES} nodes; use a smaller scene")
        path.append(index)
        above.add(index)

        # Its transform and mesh; then its children.
        node, where = document.item("nodes", index), f"nodes[{index}]"
        if extension(node, "KHR_node_visibility").get("visible") is False:
            document.count("hidden nodes, left out with all below them", where)
            continue
        world = parent @ local_matrix(document, index)
        if "mesh" in node:
            yield PlacedNode(index, node, world @ _instances(document, node, where))
        todo += [(child, world, depth + 1) for child in reversed(children(document, index))]


def _roots(document: Document) -> list[int]:
    """The root nodes of the default scene, otherwise of the first, otherwise all nodes without a parent."""
    # Without scenes: nodes without a parent.
    scenes = document.items("scenes")
    if not scenes:
        below = {
            child for index in range(len(document.items("nodes"))) for child in children(document, index)
        }
        return [index for index in range(len(document.items("nodes"))) if index not in below]

    # The roots that the scene lists.
    number = document.json.get("scene", 0)
    if not is_index(number) or number >= len(scenes):
        document.count("default scene that is not there, the first taken", "scene")
        number = 0
    roots = document.item("scenes", number).get("nodes", [])
    if not isinstance(roots, list) or not all(is_index(root) for root in roots):
        raise document.wrong("the scene has no list of nodes")

    # A root that is below another one, or listed twice, is drawn once.
    below = set()
    todo = [child for root in roots for child in children(document, root)]
    while todo:
        index = todo.pop()
        if index not in below:
            below.add(index)
            todo += children(document, index)
    proper = [root for root in dict.fromkeys(roots) if root not in below]
    if proper and len(proper) < len(roots):
        document.count("roots of the scene listed twice or with a parent", "scene", len(roots) - len(proper))
    return proper or roots


def children(document: Document, index: int) -> list[int]:
    """The numbers of a node's children."""
    indices = document.item("nodes", index).get("children", [])
    if not isinstance(indices, list) or not all(is_index(child) for child in indices):
        raise document.wrong(f"nodes[{index}].children is no list of nodes")
    return indices


def world_matrices(document: Document, nodes: list[int]) -> Matrix:
    """(N, 4, 4) from nodes to world space, whichever scene they are in."""
    parents: dict[int, int] = {}
    for index in range(len(document.items("nodes"))):
        for child in children(document, index):
            parents.setdefault(child, index)
    known: dict[int, Matrix] = {}
    for node in nodes:
        # Up to an ancestor that is known or has no parent, then down again.
        ancestors = [node]
        while ancestors[-1] not in known and ancestors[-1] in parents:
            if len(ancestors) > len(parents):
                raise document.wrong(f"nodes[{node}] is among its own descendants")
            ancestors.append(parents[ancestors[-1]])
        world = known.get(ancestors[-1], np.eye(4))
        for index in reversed(ancestors):
            if index not in known:
                known[index] = world @ local_matrix(document, index)
            world = known[index]
    return np.array([known[node] for node in nodes]).reshape(-1, 4, 4)


def local_matrix(document: Document, index: int) -> Matrix:
    """(4, 4) from a node to its parent: its matrix, stored by columns, or translation * rotation * scale."""
    node, where = document.item("nodes", index), f"nodes[{index}]"
    if "matrix" in node:
        matrix = document.numbers(node, "matrix", where, tuple(np.eye(4).ravel())).reshape(4, 4).T
        if not np.array_equal(matrix[3], (0, 0, 0, 1)):
            document.count("matrices whose last row is not 0 0 0 1, taken for it", where)
        return np.concatenate([matrix[:3], [(0, 0, 0, 1)]])
    translation = document.numbers(node, "translation", where, (0.0, 0.0, 0.0))
    rotation = document.numbers(node, "rotation", where, (0.0, 0.0, 0.0, 1.0))
    scale = document.numbers(node, "scale", where, (1.0, 1.0, 1.0))
    if not rotation.any():
        document.count("rotations of no length, left out", where)
    return composed(translation[None], rotation[None], scale[None])[0]


def composed(translation: Matrix, rotation: Matrix, scale: Matrix) -> Matrix:
    """(N, 4, 4) translation * rotation * scale; a zero quaternion is no rotation.

    Parameters
    ----------
    translation, scale : (N, 3) float64
    rotation : (N, 4) float64
        Quaternions x, y, z, w of any length.
    """
    x, y, z, w = rotation.T
    norm = np.einsum("ij,ij->i", rotation, rotation)
    s = np.divide(2, norm, out=np.zeros_like(norm), where=norm > 0)
    out = np.zeros((len(norm), 4, 4))
    out[:, 0, :3] = np.stack([1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)], axis=1)
    out[:, 1, :3] = np.stack([s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)], axis=1)
    out[:, 2, :3] = np.stack([s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)], axis=1)
    out[:, :3, :3] *= scale[:, None, :]
    out[:, :3, 3] = translation
    out[:, 3, 3] = 1
    return out


def _instances(document: Document, node: dict[str, Any], where: str) -> Matrix:
    """(I, 4, 4) transforms of the instances of a node's mesh; a single identity without instances."""
    # The tables of translations, rotations and scales.
    tables = extension(node, "EXT_mesh_gpu_instancing").get("attributes")
    if not isinstance(tables, dict):
        return np.eye(4)[None]
    tables_by_name: dict[str, Matrix] = {}
    for name, width in (("TRANSLATION", 3), ("ROTATION", 4), ("SCALE", 3)):
        if name in tables:
            tables_by_name[name] = table(document, tables[name], (width,)).astype(np.float64)
    if not tables_by_name:
        return np.eye(4)[None]

    # As many instances as the shortest table has rows.
    count = min(map(len, tables_by_name.values()))
    if count < max(map(len, tables_by_name.values())):
        document.count("instances that lack a part of their transform, left out", where)
    if count > MOST_INSTANCES:
        raise LimitError(
            f"{document.path}: {where} has {count} instances, the limit is {MOST_INSTANCES}; "
            "use a smaller scene"
        )
    if not all(np.isfinite(values[:count]).all() for values in tables_by_name.values()):
        raise document.wrong(f"{where} has instances whose place is not finite")
    return composed(
        tables_by_name.get("TRANSLATION", np.zeros((count, 3)))[:count],
        tables_by_name.get("ROTATION", np.broadcast_to([0.0, 0.0, 0.0, 1.0], (count, 4)))[:count],
        tables_by_name.get("SCALE", np.ones((count, 3)))[:count],
    )
