"""`COLOR_0`: linear colours of vertices, in the type of numbers that the file has."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from illumcli.mesh_files.gltf.accessors import table
from illumcli.mesh_files.gltf.document import Document
from illumcli.mesh_files.gltf.glb_writer import VERTICES, GlbWriter

_KINDS: dict[int, np.dtype[Any]] = {
    code: np.dtype(name) for code, name in ((5121, "u1"), (5123, "u2"), (5126, "f4"))
}


def vertex_colors(
    document: Document, attributes: dict[str, Any], count: int
) -> tuple[NDArray[np.float64], np.dtype[Any]]:
    """(N, 4) linear colours of vertices and their type; white, opaque and bytes if there are none."""
    colors, kind = np.ones((count, 4)), _KINDS[5121]
    if "COLOR_0" in attributes:
        rows = table(document, attributes["COLOR_0"], (3, 4), fractions=True)
        colors[:, : rows.shape[1]] = rows
        kind = _KINDS[document.item("accessors", attributes["COLOR_0"])["componentType"]]
    return colors, kind


def write_colors(
    writer: GlbWriter, attributes: dict[str, Any], colors: NDArray[np.float64], kind: np.dtype[Any]
) -> None:
    """Set `COLOR_0` to linear colours, (N, 4); integers hold shares of their largest value."""
    if kind.kind == "f":
        attributes["COLOR_0"] = writer.table(colors.astype(kind), VERTICES)
        return
    shares = np.rint(np.iinfo(kind).max * np.clip(colors, 0, 1)).astype(kind)
    attributes["COLOR_0"] = writer.table(shares, VERTICES, normalized=True)
