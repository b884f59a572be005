"""Refuses documents that cannot be written again: references and lists that are not what glTF says.

A reader can pass over what it does not need; a copy of the document cannot.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from illumcli.mesh_files.gltf.document import Document, is_index, printable
from illumcli.mesh_files.gltf.glb_writer import users_of_buffer

_LISTS = ("nodes", "meshes", "accessors", "bufferViews", "buffers", "images", "textures", "materials")
_ADVICE = "export the mesh again, or bake to .npz or .ply"


def refuse_malformed(document: Document) -> None:
    """Raise InputError if a part of a document that is written again is malformed; it names the part."""
    form = _Form(document)
    for kind in _LISTS:
        form.objects(document.json.get(kind, []), kind)
    for kind, references in _REFERENCES.items():
        for number, entry in enumerate(document.items(kind)):
            for key, target in references.items():
                form.reference(entry, key, target, f"{kind}[{number}]")
    for number, view in enumerate(document.items("bufferViews")):
        for user in users_of_buffer(view):
            form.check("buffer" in user, f"bufferViews[{number}].buffer")
            form.reference(user, "buffer", "buffers", f"bufferViews[{number}]")
            for key in ("byteOffset", "byteLength"):
                form.check(is_index(user.get(key, 0)), f"bufferViews[{number}].{key}")
    for number, material in enumerate(document.items("materials")):
        form.check(isinstance(material.get("occlusionTexture", {}), dict), f"materials[{number}]")
    for number, mesh in enumerate(document.items("meshes")):
        where = f"meshes[{number}].primitives"
        form.objects(mesh.get("primitives"), where)
        for k, primitive in enumerate(mesh["primitives"]):
            form.primitive(primitive, f"{where}[{k}]")
    for number, node in enumerate(document.items("nodes")):
        form.check(isinstance(node.get("children", []), list), f"nodes[{number}].children")


_REFERENCES: Mapping[str, Mapping[str, str]] = {
    "nodes": {"mesh": "meshes"},
    "accessors": {"bufferView": "bufferViews"},
    "images": {"bufferView": "bufferViews"},
    "textures": {"source": "images"},
}
"""List -> key of its entries -> the list that it refers to."""


class _Form:
    """Checks parts of a document."""

    def __init__(self, document: Document) -> None:
        self._document = document

    def check(self, is_right: bool, where: str) -> None:
        """Refuse the part `where` unless it is right."""
        if not is_right:
            raise self._document.wrong(f"{printable(where)} is malformed, so it cannot be copied", _ADVICE)

    def objects(self, value: Any, where: str) -> None:
        """A list of objects."""
        self.check(isinstance(value, list), where)
        for number, each in enumerate(value):
            self.check(isinstance(each, dict), f"{where}[{number}]")

    def reference(self, entry: Mapping[str, Any], key: str, kind: str, where: str) -> None:
        """A number in a list, if there is one."""
        value = entry.get(key, 0)
        is_right = is_index(value) and (key not in entry or value < len(self._document.items(kind)))
        self.check(is_right, f"{where}.{key}")

    def primitive(self, primitive: Mapping[str, Any], where: str) -> None:
        """The tables of a primitive, its indices and its material."""
        self.reference(primitive, "indices", "accessors", where)
        self.reference(primitive, "material", "materials", where)
        self.check(isinstance(primitive.get("attributes", {}), dict), f"{where}.attributes")
        self.objects(primitive.get("targets", []), f"{where}.targets")
        for table in (primitive.get("attributes", {}), *primitive.get("targets", [])):
            for name in table:
                self.reference(table, name, "accessors", where)
