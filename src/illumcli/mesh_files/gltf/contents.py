"""What a glTF document holds beside the mesh that is read from it."""

from __future__ import annotations

from typing import Any

from illumcli.mesh_files.gltf.document import Document

DEFORMERS = ("skins", "morph targets")
"""Kinds of content that move vertices."""
_TOP_LEVEL = {"skins": "skins", "animations": "animations", "cameras": "cameras"}


def beside_mesh(document: Document) -> list[str]:
    """Names of the kinds of content that other mesh formats have no place for."""
    primitives = [each for mesh in document.items("meshes") for each in mesh.get("primitives", [])]
    attributes = {name for each in primitives for name in each.get("attributes", {})}
    has: dict[str, Any] = {name: document.items(key) for key, name in _TOP_LEVEL.items()}
    has["morph targets"] = any(each.get("targets") for each in primitives)
    has["tangents"] = "TANGENT" in attributes
    has["uv sets other than the first"] = any(
        name.startswith("TEXCOORD_") for name in attributes - {"TEXCOORD_0"}
    )
    has["colour sets other than the first"] = any(
        name.startswith("COLOR_") for name in attributes - {"COLOR_0"}
    )
    return [name for name, value in has.items() if value]
