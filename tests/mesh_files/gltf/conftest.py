"""glTF documents under construction, for the tests of their reader."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

KINDS = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], "f4")


class Scene:
    """A glTF document under construction: one buffer, one view per table."""

    def __init__(self) -> None:
        self.data = b""
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": []}],
            "accessors": [],
            "bufferViews": [],
        }

    def table(self, values: Any, kind: str = "f4", **more: Any) -> int:
        array = np.array(values, kind)
        self.json["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": array.nbytes}
        )
        self.data += array.tobytes() + b"\0" * (-array.nbytes % 4)
        width = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}[
            1 if array.ndim == 1 else array.shape[1]
        ]
        view = len(self.json["bufferViews"]) - 1
        entry = {"bufferView": view, "componentType": KINDS[kind], "count": len(array), "type": width, **more}
        self.json["accessors"].append(entry)
        return len(self.json["accessors"]) - 1

    def primitive(
        self, indices: Any = None, mode: int | None = None, mesh: int = 0, **attributes: int
    ) -> dict:
        made: dict[str, Any] = {"attributes": {"POSITION": self.table(CORNERS), **attributes}}
        if indices is not None:
            made["indices"] = self.table(indices, "u2")
        if mode is not None:
            made["mode"] = mode
        self.json["meshes"][mesh]["primitives"].append(made)
        return made

    def write(self, path: Path, uri: str | None = None) -> Path:
        self.json["buffers"] = [{"byteLength": len(self.data)}]
        if path.suffix == ".gltf":
            inline = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
            self.json["buffers"][0]["uri"] = inline if uri is None else uri
            path.write_text(json.dumps(self.json))
            return path
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        chunks = len(text).to_bytes(4, "little") + b"JSON" + text
        chunks += len(self.data).to_bytes(4, "little") + b"BIN\0" + self.data
        path.write_bytes(
            b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks
        )
        return path


@pytest.fixture(name="Scene")
def scene_class() -> type[Scene]:
    """An empty document."""
    return Scene


@pytest.fixture(name="square")
def square_maker() -> Any:
    """Makes a document of one square."""

    def make() -> Scene:
        scene = Scene()
        scene.primitive([0, 1, 2, 0, 2, 3])
        return scene

    return make
