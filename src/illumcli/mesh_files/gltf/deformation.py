"""Deformation by morph targets and skins in the rest pose (glTF 2.0 specification, 3.7.2.2 and 3.7.3)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.errors import InputError
from illumcli.mesh_files.gltf.accessors import table
from illumcli.mesh_files.gltf.document import Document, is_finite
from illumcli.mesh_files.gltf.nodes import Matrix, PlacedNode, world_matrices


def morphed(
    document: Document,
    values: NDArray[np.float64],
    name: str,
    primitive: dict[str, Any],
    weights: list[float],
) -> NDArray[np.float64]:
    """(V, k) the attribute `name` plus its morph targets, each times its weight."""
    targets = primitive.get("targets", [])
    if not any(weights) or not isinstance(targets, list):
        return values
    for number, (target, weight) in enumerate(zip(targets, weights, strict=False)):
        if not weight or not isinstance(target, dict) or name not in target:
            continue
        offsets = table(document, target[name], (values.shape[1],))
        if len(offsets) != len(values):
            raise document.wrong(f"morph target {number} has {len(offsets)} rows for {len(values)} vertices")
        values = values + weight * offsets.astype(np.float64)
    return values


def weights_of(document: Document, node: dict[str, Any], mesh: dict[str, Any], where: str) -> list[float]:
    """The weights of a mesh's morph targets at a node: the node's, otherwise the mesh's, otherwise none."""
    weights = node.get("weights", mesh.get("weights", []))
    if not isinstance(weights, list) or not all(is_finite(weight) for weight in weights):
        document.count("weights of morph targets that are no numbers, left out", where)
        return []
    return weights


def skin_matrices(
    document: Document, placed: PlacedNode, attributes: dict[str, Any], size: int
) -> Matrix | None:
    """(V, 4, 4) from each vertex to world space in the rest pose; None for a node without a skin.

    The sum over the vertex's joints of weight * (joint to world) * (inverse bind matrix). The transform of
    the node itself is ignored (3.7.3.1). Weights are divided by their sum; a vertex without weights follows
    its first joint.

    Raises
    ------
    InputError
        A skin, joints or weights that cannot be read.
    """
    if "skin" not in placed.node:
        return None
    where = f"skins[{placed.node['skin']!r:.20}]"
    skin = document.item("skins", placed.node["skin"])

    # The joints in the rest pose.
    nodes = skin.get("joints")
    if not isinstance(nodes, list) or not nodes:
        raise document.wrong(f"{where} has no list of joints")
    for node in nodes:
        document.item("nodes", node)
    joints = world_matrices(document, nodes)
    if "inverseBindMatrices" in skin:
        inverse = table(document, skin["inverseBindMatrices"], (16,)).astype(np.float64)
        if len(inverse) < len(nodes):
            raise document.wrong(f"{where} has {len(inverse)} inverse bind matrices for {len(nodes)} joints")
        joints = joints @ inverse[: len(nodes)].reshape(-1, 4, 4).transpose(0, 2, 1)
    if not np.isfinite(joints).all():
        raise document.wrong(f"{where} has matrices that are not finite")

    # The joints of each vertex, and their weights.
    sets = [f"{n}" for n in range(len(attributes)) if f"JOINTS_{n}" in attributes]
    if not sets:
        raise document.wrong(f"{where} deforms a primitive without joints")
    index = np.concatenate([_rows(document, attributes, f"JOINTS_{n}", size) for n in sets], axis=1)
    weight = np.concatenate([_rows(document, attributes, f"WEIGHTS_{n}", size) for n in sets], axis=1)
    if not np.isfinite(weight).all() or index.max(initial=0) >= len(nodes) or index.min(initial=0) < 0:
        raise document.wrong(f"{where} deforms vertices by joints or weights that are not there")
    total = weight.sum(axis=1, keepdims=True)
    first = np.arange(weight.shape[1]) == 0
    weight = np.divide(weight, total, out=np.broadcast_to(first * 1.0, weight.shape).copy(), where=total > 0)

    # Their weighted sum, one influence after the other: (V, influences, 4, 4) would be large.
    out = np.zeros((size, 4, 4))
    for column, share in zip(index.astype(np.intp).T, weight.T, strict=True):
        out += share[:, None, None] * joints[column]
    return out


def _rows(document: Document, attributes: dict[str, Any], name: str, size: int) -> NDArray[np.float64]:
    """(V, 4) of a vertex attribute; weights as fractions."""
    rows = table(document, attributes.get(name), (4,), fractions=name.startswith("WEIGHTS"))
    if len(rows) != size:
        raise document.wrong(f"{name} has {len(rows)} rows for {size} vertices")
    return rows.astype(np.float64)


def skinned_or_placed(
    document: Document, placed: PlacedNode, attributes: dict[str, Any], size: int, where: str
) -> Matrix:
    """(I, 1, 4, 4) transforms of a node's instances, or (1, V, 4, 4) of the vertices that a skin deforms.

    A skin that cannot be read is left out and counted: the mesh then has the transform of its node.
    """
    try:
        skinned = skin_matrices(document, placed, attributes, size)
    except InputError as error:
        document.count(f"skins left out ({document.reason(error)})", where)
        skinned = None
    return placed.worlds[:, None] if skinned is None else skinned[None]
