"""Meshes of a glTF document for every distinct set of values at their places."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

import numpy as np

from illumcli.mesh_files.gltf.accessors import table
from illumcli.mesh_files.gltf.document import Document, extension
from illumcli.mesh_files.gltf.placed_values import MeshValues, Place, digest

INSTANCING = "EXT_mesh_gpu_instancing"
_TRANSFORM = {"TRANSLATION": (3,), "ROTATION": (4,), "SCALE": (3,)}


def distinct_meshes(document: Document, meshes: dict[int, dict[Place, MeshValues]]) -> dict[int, MeshValues]:
    """Mesh -> its values, after copies of meshes were added to the document for places with other values.

    A copy refers to the accessors of its mesh. A mesh without values at some node of the document keeps its
    own attributes there. Instances with different values become nodes.
    """
    distinct: dict[int, MeshValues] = {}
    of_nodes: dict[int, list[int]] = {}
    for mesh, places in meshes.items():
        users = {i for i, node in enumerate(document.items("nodes")) if node.get("mesh") == mesh}
        mesh_is_free = users <= {node for node, _ in places}
        numbers: dict[bytes, int] = {}
        for (node, _), values in places.items():
            key = digest(values)
            if key not in numbers:
                numbers[key] = mesh if mesh_is_free else len(document.json["meshes"])
                if not mesh_is_free:
                    document.json["meshes"].append(deepcopy(document.json["meshes"][mesh]))
                mesh_is_free = False
                distinct[numbers[key]] = values
            of_nodes.setdefault(node, []).append(numbers[key])

    # Give the nodes their meshes.
    for node, numbers_of_node in of_nodes.items():
        if len(set(numbers_of_node)) > 1:
            _expand(document, node, numbers_of_node)
        elif node >= 0:
            document.json["nodes"][node]["mesh"] = numbers_of_node[0]
    if not any(extension(node, INSTANCING) for node in document.items("nodes")):
        forget_extension(document.json, INSTANCING)
    return distinct


def _expand(document: Document, index: int, meshes: list[int]) -> None:
    """Make a child of a node for each of its instances; other attributes of instances become extras."""
    nodes = document.json["nodes"]
    node = nodes[index]
    tables = node["extensions"].pop(INSTANCING)["attributes"]
    if not node["extensions"]:
        del node["extensions"]
    rows = {
        name: table(document, number, _TRANSFORM.get(name, (1, 2, 3, 4))) for name, number in tables.items()
    }
    more = {key: node[key] for key in ("weights",) if key in node}
    node.pop("weights", None)
    del node["mesh"]
    children = node.setdefault("children", [])
    for instance, mesh in enumerate(meshes):
        child: dict[str, Any] = {"mesh": mesh, **more}
        for name, values in rows.items():
            row = values[instance].astype(np.float64)
            if name == "ROTATION":
                row = row / np.linalg.norm(row) if row.any() else np.array([0.0, 0.0, 0.0, 1.0])
            place = child if name in _TRANSFORM else child.setdefault("extras", {})
            place[name.lower() if name in _TRANSFORM else name] = row.tolist()
        children.append(len(nodes))
        nodes.append(child)


def forget_extension(document: dict[str, Any], name: str) -> None:
    """Remove the name of an extension from the lists of those in use and required."""
    for key in ("extensionsUsed", "extensionsRequired"):
        names = document.get(key)
        if isinstance(names, list) and name in names:
            names.remove(name)
            if not names:
                del document[key]
